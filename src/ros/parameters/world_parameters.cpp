#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "ist_proximity/proximity/world_file.h"
#include "ros/common/text.h"
#include "ros/parameters/parameter_table.h"

namespace ist {
namespace {

Eigen::Isometry3d pose_of(const WrittenObject& written) {
  return Eigen::Translation3d(written.position) *
         Eigen::AngleAxisd(written.rpy[2], Eigen::Vector3d::UnitZ()) *
         Eigen::AngleAxisd(written.rpy[1], Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(written.rpy[0], Eigen::Vector3d::UnitX());
}

/// Sizes have no defaults.
void require_sizes(ParameterReader* reader, const std::string& at,
                   const std::vector<Parameter>& rows, const std::string& mesh) {
  for (const Parameter& row : rows) {
    const std::string name = row.name.substr(at.size());
    const bool is_size = name == "size" || name == "radius" || name == "length";
    if ((is_size && !reader->has(row.name)) || (name == "mesh" && mesh.empty())) {
      reader->add_error(row.name, "is not set: it is needed for this shape");
    }
  }
}

/// @returns no geometry for a mesh, which the source's thread reads
std::vector<GeometryElement> geometry_of(const std::string& shape, const WrittenObject& written) {
  GeometryElement element;
  element.source = shape;
  if (shape == "mesh") return {};
  if (shape == "plane") return {half_space(Eigen::Vector3d::UnitZ(), 0.0)};
  if (shape == "box") element.shape = Box{written.size};
  if (shape == "sphere") element.shape = Sphere{written.radius};
  if (shape == "cylinder") element.shape = Cylinder{written.radius, written.length};
  if (shape == "cone") element.shape = cone(written.radius, written.length);
  return {element};
}

void read_objects(ParameterReader* reader, const std::string& at, WorldConfig* world) {
  const std::vector<std::string> names = reader->children(at + "objects");
  if (names.size() > world->limits.max_objects) {
    reader->add_error(at + "objects", "holds " + std::to_string(names.size()) +
                                          " objects: allowed are " +
                                          std::to_string(world->limits.max_objects));
    return;
  }
  for (const std::string& name : names) {
    world->objects.emplace_back();
    WorldObject& object = world->objects.back().object;
    object.name = name;
    object.frame = world->frame_id;
    object.margin = world->margin;
    read_object(reader, at + "objects/" + name + "/", true, &world->objects.back());
  }
}

}  // namespace

void read_object(ParameterReader* reader, const std::string& at, bool has_margin,
                 WorldObjectConfig* config) {
  WrittenObject written;
  reader->read(object_parameters(at, &written, config).front());  // the others depend on the shape
  std::vector<Parameter> rows = object_parameters(at, &written, config);
  if (!has_margin) rows.pop_back();
  reader->read_all(rows);
  require_sizes(reader, at, rows, config->mesh);
  config->object.X_BO = pose_of(written);
  if (written.shape == WrittenObject::kShapes.size()) {
    if (reader->has(at + "shape")) return;
    reader->add_error(at + "shape", "is not set: allowed is " + join(WrittenObject::kShapes, ", "));
    return;
  }
  config->object.geometry = geometry_of(WrittenObject::kShapes[written.shape], written);
}

void read_world(ParameterReader* reader, const std::string& at, SourceConfig* source) {
  WorldConfig& world = source->world;
  read_objects(reader, at, &world);
  if (reader->has(at + "robot") && world.robot.description.empty()) {
    reader->add_error(at + "robot/description",
                      "is not set: the name of the parameter that holds the other robot's URDF is "
                      "needed, for example /other/robot_description");
  }
  world.has_topic = reader->has(at + "topic");
  if (!world.has_topic && source->file.empty() && !reader->has(at + "objects") &&
      world.robot.description.empty()) {
    reader->add_error(at + "type",
                      "is world: at least one of objects, file, topic or robot is needed");
  }
}

}  // namespace ist
