#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "internal/geometry/limits.h"
#include "internal/geometry/numbers.h"
#include "ist_proximity/proximity/world_file.h"
#include "ros/common/text.h"
#include "ros/parameters/source_parameters.h"

namespace ist {
namespace {

const Range kSize = Range::positive("m", kMaxLength);
const Range kPosition{"m", -kMaxLength, kMaxLength};
const Range kMargin = Range::non_negative("m", kMaxLength);

void read_pose(ParameterReader* reader, const std::string& at, Eigen::Isometry3d* X) {
  Eigen::Vector3d p(0.0, 0.0, 0.0), rpy(0.0, 0.0, 0.0);
  Eigen::Quaterniond q = Eigen::Quaterniond::Identity();  // in memory x, y, z, w
  reader->read_all({{at + "position", Numbers{p.data(), 3}, kPosition},
                    {at + "rpy", Numbers{rpy.data(), 3}, {"rad", -100.0, 100.0}},
                    {at + "orientation", Numbers{q.coeffs().data(), 4}, {"", -1.001, 1.001}}});
  if (reader->has(at + "rpy") && reader->has(at + "orientation")) {
    reader->add_error(at + "rpy", "and ~" + at + "orientation are both set: one is needed");
  }
  if (!(std::abs(q.norm() - 1.0) < 1e-3)) {
    reader->add_error(at + "orientation", "has a length of " + number_text(q.norm()) +
                                              ": a quaternion x, y, z, w of length 1 is needed");
    q.setIdentity();
  }
  if (reader->has(at + "rpy")) {
    q = Eigen::AngleAxisd(rpy[2], Eigen::Vector3d::UnitZ()) *
        Eigen::AngleAxisd(rpy[1], Eigen::Vector3d::UnitY()) *
        Eigen::AngleAxisd(rpy[0], Eigen::Vector3d::UnitX());
  }
  X->linear() = q.normalized().toRotationMatrix();
  X->translation() = p;
}

// A number that has no default.
double needed_size(ParameterReader* reader, const std::string& name) {
  double value = 1.0;
  if (!reader->has(name)) reader->add_error(name, "is not set: it is needed for this shape");
  reader->read({name, &value, kSize});
  return value;
}

void read_shape(ParameterReader* reader, const std::string& at, WorldObjectConfig* config) {
  const std::vector<std::string> shapes = {"box", "sphere", "cylinder", "cone", "plane", "mesh"};
  std::size_t chosen = shapes.size();
  reader->read({at + "shape", choice(&chosen, shapes)});
  if (chosen == shapes.size()) {
    if (!reader->has(at + "shape")) {
      reader->add_error(at + "shape", "is not set: allowed is " + join(shapes, ", "));
    }
    return;
  }
  const std::string& shape = shapes[chosen];
  GeometryElement element;
  element.source = shape;
  if (shape == "box") {
    Box box{{1.0, 1.0, 1.0}};
    if (!reader->has(at + "size")) {
      reader->add_error(at + "size", "is not set: a box needs its edges along x, y, z");
    }
    reader->read({at + "size", Numbers{box.size.data(), 3}, kSize});
    element.shape = box;
  } else if (shape == "sphere") {
    element.shape = Sphere{needed_size(reader, at + "radius")};
  } else if (shape == "cylinder" || shape == "cone") {
    const double radius = needed_size(reader, at + "radius");
    const double length = needed_size(reader, at + "length");
    element.shape = shape == "cone" ? Shape(cone(radius, length)) : Shape(Cylinder{radius, length});
  } else if (shape == "plane") {
    element = half_space(Eigen::Vector3d::UnitZ(), 0.0);
  } else {
    reader->read_all(
        {{at + "mesh", &config->mesh},
         {at + "scale", Numbers{config->scale.data(), 3}, {"", -kMaxScale, kMaxScale}}});
    if (config->mesh.empty()) {
      reader->add_error(at + "mesh",
                        "is not set: the URI of a file is needed, for example "
                        "package://cell/meshes/fixture.stl");
    }
    return;
  }
  config->object.geometry = {element};
}

void read_object(ParameterReader* reader, const std::string& at, const WorldConfig& world,
                 WorldObjectConfig* config) {
  WorldObject& object = config->object;
  object.frame = world.frame_id;
  object.margin = world.margin;
  reader->read_all({{at + "frame_id", &object.frame},
                    {at + "margin", &object.margin, kMargin},
                    {at + "allowed_links", &object.allowed_links}});
  read_pose(reader, at, &object.X_BO);
  read_shape(reader, at, config);
}

void read_objects(ParameterReader* reader, const std::string& at, WorldConfig* world) {
  const std::vector<std::string> names = reader->children(at + "objects");
  if (names.size() > world->limits.max_objects) {
    reader->add_error(at + "objects",
                      "holds " + std::to_string(names.size()) + " objects: allowed are " +
                          std::to_string(world->limits.max_objects) + " (max_objects)");
    return;
  }
  const std::string folder = at + "objects/";
  for (const std::string& name : names) {
    world->objects.emplace_back();
    world->objects.back().object.name = name;
    const std::string object = folder + name;
    read_object(reader, object + "/", *world, &world->objects.back());
  }
}

void read_robot(ParameterReader* reader, const std::string& at, OtherRobotConfig* robot) {
  if (!reader->has(at)) return;
  reader->read_all({{at + "/description", &robot->description},
                    {at + "/tf_prefix", &robot->tf_prefix},
                    {at + "/joint_states", &robot->joint_states}});
  if (robot->description.empty()) {
    reader->add_error(at + "/description",
                      "is not set: the name of the parameter that holds the other robot's URDF is "
                      "needed, for example /other/robot_description");
  }
}

}  // namespace

void read_world(ParameterReader* reader, const std::string& at, SourceConfig* source) {
  WorldConfig& world = source->world;
  source->ingest.self_filter = false;
  reader->read_all({{at + "frame_id", &world.frame_id},
                    {at + "max_objects", &world.limits.max_objects, {"", 1.0, 1e6}},
                    {at + "max_triangles", &world.limits.max_triangles, {"", 1.0, 1e8}},
                    {at + "margin", &world.margin, kMargin},
                    {at + "allowed_contacts", &world.allowed_contacts}});
  const std::string margins = at + "link_margins/";
  for (const std::string& link : reader->children(at + "link_margins")) {
    reader->read({margins + link, &world.link_margins[link], kMargin});
  }
  read_objects(reader, at, &world);
  read_robot(reader, at + "robot", &world.robot);
  if (reader->has(at + "file"))
    read_path(reader, at + "file", "/home/robot/cell.scene", &source->file);
  world.has_topic = reader->has(at + "topic");
  source->timeout = kInfinity;  // objects are sent when they change
  if (world.has_topic) {
    reader->read_all({{at + "timeout", &source->timeout, Range::positive("s", kInfinity, true)},
                      {at + "max_leaves", &source->map.max_leaves, {"", 1.0, 5e7}}});
  }
  if (!world.has_topic && source->file.empty() && !reader->has(at + "objects") &&
      world.robot.description.empty()) {
    reader->add_error(at + "type",
                      "is world: at least one of objects, file, topic or robot is needed");
  }
}

}  // namespace ist
