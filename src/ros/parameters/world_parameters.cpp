#include "ros/parameters/world_parameters.h"

#include <Eigen/Geometry>
#include <limits>
#include <vector>

#include "internal/geometry/limits.h"
#include "ist_proximity/proximity/world_file.h"

namespace ist {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
const Range kSize = Range::positive("m", kMaxLength);
const Range kPosition{"m", -kMaxLength, kMaxLength};
const Range kAngle{"rad", -100.0, 100.0};
const Range kLeaves{"", 1.0, 5e7};
const Range kMargin = Range::non_negative("m", kMaxLength);

void read_pose(ParameterReader* reader, const std::string& prefix, Eigen::Isometry3d* X) {
  std::vector<double> p = {0.0, 0.0, 0.0}, rpy = {0.0, 0.0, 0.0}, q = {0.0, 0.0, 0.0, 1.0};
  reader->read(prefix + "position", kPosition, 3, &p);
  reader->read(prefix + "rpy", kAngle, 3, &rpy);
  reader->read(prefix + "orientation", Range{"", -1.001, 1.001}, 4, &q);
  if (reader->has(prefix + "rpy") && reader->has(prefix + "orientation")) {
    reader->add_error("~" + prefix + "rpy and ~" + prefix +
                      "orientation are both set: one is needed");
  }
  Eigen::Quaterniond rotation(q[3], q[0], q[1], q[2]);
  if (!(std::abs(rotation.norm() - 1.0) < 1e-3)) {
    reader->add_error("~" + prefix + "orientation has a length of " + number_text(rotation.norm()) +
                      ": a quaternion x, y, z, w of length 1 is needed");
    rotation = Eigen::Quaterniond::Identity();
  }
  if (reader->has(prefix + "rpy")) {
    rotation = Eigen::AngleAxisd(rpy[2], Eigen::Vector3d::UnitZ()) *
               Eigen::AngleAxisd(rpy[1], Eigen::Vector3d::UnitY()) *
               Eigen::AngleAxisd(rpy[0], Eigen::Vector3d::UnitX());
  }
  X->linear() = rotation.normalized().toRotationMatrix();
  X->translation() << p[0], p[1], p[2];
}

// A number that has no default.
double needed_size(ParameterReader* reader, const std::string& name) {
  double value = 1.0;
  if (!reader->has(name))
    reader->add_error("~" + name + " is not set: it is needed for this shape");
  reader->read(name, kSize, &value);
  return value;
}

void read_shape(ParameterReader* reader, const std::string& prefix, WorldObjectConfig* config) {
  const std::vector<std::string> shapes = {"box", "sphere", "cylinder", "cone", "plane", "mesh"};
  std::string shape;
  reader->read_choice(prefix + "shape", shapes, &shape);
  GeometryElement element;
  element.source = shape;
  if (shape == "box") {
    std::vector<double> size = {1.0, 1.0, 1.0};
    if (!reader->has(prefix + "size")) {
      reader->add_error("~" + prefix + "size is not set: a box needs its edges along x, y, z");
    }
    reader->read(prefix + "size", kSize, 3, &size);
    element.shape = Box{{size[0], size[1], size[2]}};
  } else if (shape == "sphere") {
    element.shape = Sphere{needed_size(reader, prefix + "radius")};
  } else if (shape == "cylinder" || shape == "cone") {
    const double radius = needed_size(reader, prefix + "radius");
    const double length = needed_size(reader, prefix + "length");
    element.shape = shape == "cone" ? Shape(cone(radius, length)) : Shape(Cylinder{radius, length});
  } else if (shape == "plane") {
    element = half_space(Eigen::Vector3d::UnitZ(), 0.0);
  } else if (shape == "mesh") {
    reader->read(prefix + "mesh", &config->mesh);
    if (config->mesh.empty()) {
      reader->add_error("~" + prefix +
                        "mesh is not set: the URI of a file is needed, for example "
                        "package://cell/meshes/fixture.stl");
    }
    std::vector<double> scale = {1.0, 1.0, 1.0};
    reader->read(prefix + "scale", Range{"", -kMaxScale, kMaxScale}, 3, &scale);
    config->scale << scale[0], scale[1], scale[2];
    return;
  }
  config->object.geometry = {element};
}

void read_object(ParameterReader* reader, const std::string& name, const std::string& prefix,
                 const WorldConfig& world, WorldObjectConfig* config) {
  WorldObject& object = config->object;
  object.name = name;
  object.frame = world.frame_id;
  object.margin = world.margin;
  reader->read(prefix + "frame_id", &object.frame);
  reader->read(prefix + "margin", kMargin, &object.margin);
  reader->read(prefix + "allowed_links", &object.allowed_links);
  read_pose(reader, prefix, &object.X_BO);
  read_shape(reader, prefix, config);
}

void read_objects(ParameterReader* reader, const std::string& prefix, WorldConfig* world) {
  const std::vector<std::string> names = reader->children(prefix + "objects");
  if (names.size() > world->limits.max_objects) {
    reader->add_error("~" + prefix + "objects holds " + std::to_string(names.size()) +
                      " objects: allowed are " + std::to_string(world->limits.max_objects) +
                      " (max_objects)");
    return;
  }
  const std::string folder = prefix + "objects/";
  for (const std::string& name : names) {
    const std::string at = folder + name;
    reader->children(at);  // adds an error unless it is a dictionary
    world->objects.emplace_back();
    read_object(reader, name, at + "/", *world, &world->objects.back());
  }
}

void read_robot(ParameterReader* reader, const std::string& prefix, OtherRobotConfig* robot) {
  if (!reader->has(prefix + "robot")) return;
  reader->children(prefix + "robot");
  reader->read(prefix + "robot/description", &robot->description);
  reader->read(prefix + "robot/tf_prefix", &robot->tf_prefix);
  reader->read(prefix + "robot/joint_states", &robot->joint_states);
  if (robot->description.empty()) {
    reader->add_error("~" + prefix +
                      "robot/description is not set: the name of the parameter that holds the "
                      "other robot's URDF is needed, for example /other/robot_description");
  }
}

// Changes of the world come on one topic, of the one type or of the other.
void read_topic(ParameterReader* reader, const std::string& prefix, SourceConfig* source) {
  WorldConfig& world = source->world;
  world.has_topic = reader->has(prefix + "topic");
  world.is_planning_scene = reader->has(prefix + "planning_scene");
  source->timeout = kInf;  // objects are sent when they change
  if (world.is_planning_scene) {
    if (world.has_topic) {
      reader->add_error("~" + prefix + "topic and ~" + prefix +
                        "planning_scene are both set: a source has one of them; give the other one "
                        "a source of its own");
    }
    world.has_topic = true;
    reader->read(prefix + "planning_scene", &source->topic);
    if (source->topic.empty()) {
      reader->add_error("~" + prefix +
                        "planning_scene is empty: the name of a topic is needed, for example "
                        "/move_group/monitored_planning_scene");
    }
    reader->read(prefix + "planning_scene_service", &world.scene_service);
    reader->read(prefix + "starts_empty", &world.starts_empty);
    reader->read(prefix + "use_allowed_collisions", &world.use_allowed_collisions);
    reader->read(prefix + "max_leaves", kLeaves, &source->map.max_leaves);  // of the octomap
  }
  if (world.has_topic) {
    reader->read(prefix + "timeout", Range::positive("s", kInf, true), &source->timeout);
  }
}

}  // namespace

void read_world(ParameterReader* reader, const std::string& prefix, SourceConfig* source) {
  WorldConfig& world = source->world;
  source->ingest.self_filter = false;
  reader->read(prefix + "frame_id", &world.frame_id);
  reader->read(prefix + "max_objects", Range{"", 1.0, 1e6}, &world.limits.max_objects);
  reader->read(prefix + "max_triangles", Range{"", 1.0, 1e8}, &world.limits.max_triangles);
  reader->read(prefix + "margin", kMargin, &world.margin);
  const std::string margins = prefix + "link_margins/";
  for (const std::string& link : reader->children(prefix + "link_margins")) {
    double margin = 0.0;
    reader->read(margins + link, kMargin, &margin);
    world.link_margins[link] = margin;
  }
  reader->read(prefix + "allowed_contacts", &world.allowed_contacts);
  read_objects(reader, prefix, &world);
  read_robot(reader, prefix, &world.robot);
  if (reader->has(prefix + "file")) {
    reader->read(prefix + "file", &source->file);
    if (source->file.empty() || source->file[0] != '/') {
      reader->add_error("~" + prefix + "file is \"" + source->file +
                        "\": an absolute path is needed, for example /home/robot/cell.scene");
    }
  }
  read_topic(reader, prefix, source);
  if (!world.has_topic && source->file.empty() && !reader->has(prefix + "objects") &&
      world.robot.description.empty()) {
    reader->add_error(
        "~" + prefix +
        "type is world: at least one of objects, file, topic, planning_scene or robot is needed");
  }
}

}  // namespace ist
