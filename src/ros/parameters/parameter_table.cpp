#include "ros/parameters/parameter_table.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "internal/geometry/limits.h"
#include "internal/geometry/numbers.h"

namespace ist {
namespace {

// These numbers are no parameters: each stands in the configuration, and its reason here.
// - RepulsionConfig::filter_time hides the step of a new cloud, and delays nothing else.
// - SpeedScaleConfig: slow_distance, as a line is what controllers expect; self_stop_distance and
//   self_free_distance, as distances from link to link have no noise and fit every arm.
// - ExtentConfig::footprint_radius adds to calibration.
// - ExtentConfig::sigmas: bounds are to hold; speed: a walking person's, as in ISO 13855.
// - ViewFilterConfig: errors of a calibrated camera; the filter finds the rest, and tells doubts.
// - MemoryConfig::max_range: farther rays cost time, and reach no arm.
// - IngestConfig::sensor_range and kMinMeasured tell a broken sensor, not how good it is.
// - IngestConfig::max_points, OctreeLimits and WorldLimits keep a broken message from taking the
//   memory; no sensor, map or cell has as many.
// - A pair of links that is not to be watched is one that an SRDF disables.
// - kAttachTime and SelfCollisionConfig::kRate are what a pick and a controller need.
// - TrajectoryConfig::tolerance: a robot that is farther off does not follow.
// - SeparationConfig::intrusion and uncertainty: ~query/margin is taken off the same bounds.
// - NoiseFilterConfig::neighbors: a larger radius stands for fewer of them.
// - ExtentConfig::calibration_angle is a sensor model's own; a mounting's error is calibration.
// - PenetrationConfig::stiffness scales all wrenches alike, as a reader can.
// - kMostAttached: each object is packed, and measured by every query.
// - A memory is in ~fixed_frame, which stands still for a robot that drives, too.

// The ranges that a parameter accepts are much wider than its slider, which ends where robots and
// cameras need it to, so that a pixel means something.
constexpr double kToMaxDistance = 0.0;
const Range kLength = Range::non_negative("m", 1e3), kShort = Range::non_negative("m", 1.0);
const Range kTime = Range::positive("s", kInfinity, true);
const Range kMargin = Range::non_negative("m", kMaxLength);
const Range kSize = Range::positive("m", kMaxLength);

Parameter row(std::string name, Parameter::Value value, const Range& range, const char* help = "",
              double slider = Parameter::kStartOnly, bool may_stand_alone = false) {
  return {std::move(name), std::move(value), range, help, slider, may_stand_alone};
}

Parameter row(std::string name, Parameter::Value value, const char* help,
              bool may_stand_alone = false) {
  return row(std::move(name), std::move(value), {}, help, Parameter::kStartOnly, may_stand_alone);
}

void append(std::vector<Parameter> more, std::vector<Parameter>* table) {
  table->insert(table->end(), std::make_move_iterator(more.begin()),
                std::make_move_iterator(more.end()));
}

std::vector<Parameter> model_and_pose_parameters(ServerConfig* config) {
  return {
      row("robot_description", &config->robot_description,
          "Name of the parameter that holds the URDF."),
      row("fixed_frame", &config->fixed_frame,
          "Frame of results, in which obstacles stand still. Default: the root link; to drive, "
          "odom."),
      row("max_distance", &config->query.max_distance, Range::positive("m", 1e3),
          "A link with no obstacle within this distance is CLEAR."),
      row("pose_source", choice(&config->pose_source, {"tf", "joint_states"}),
          "joint_states: the node computes poses, and answers each message of that topic."),
      row("rate", &config->rate, {"Hz", 0.01, 1000.0}, "Results per second with pose_source: tf."),
      row("pose_timeout", &config->pose_timeout, Range::positive("s", 3600.0),
          "A link whose pose is older is UNKNOWN, and the status says NO_POSE."),
      row("links", &config->model.links,
          "Links to monitor. Default: all with geometry, but for hulls that the SRDF disables."),
      row("ignore_links", &config->ignore_links,
          "Links that do not count in ~min_distance, ~speed_scale and the diagnostics."),
      row("min_distance/fixed_links", &config->fixed_links_count,
          "Whether links that cannot move in the fixed frame count there."),
      row("self_filter_links",
          WordOr{choice(&config->self_filter_all, {"monitored", "all"}),
                 &config->self_filter_links},
          "Links whose points self-filters drop; or a list. Points on others are obstacles."),
      row("geometry", choice(&config->geometry, {"collision", "visual"}),
          "Geometry of the URDF to use. A link without collision geometry uses its visual one."),
      row("packing/max_error", &config->model.packing.max_error, Range::positive("m", 1.0),
          "Gap from a link's surface to the spheres of its volume; distances are exact anyway."),
      row("packing/max_spheres", &config->model.packing.max_spheres, {"", 1.0, 1e6},
          "Per link. Where this is reached before max_error, the node gives the gap."),
      row("cache_directory", Path{&config->model.cache_directory},
          "Folder of packings; \"\": none. Default: ~/.ros/ist_proximity, or that of $ROS_HOME."),
  };
}

std::vector<Parameter> answer_parameters(ServerConfig* config) {
  QueryConfig& query = config->query;
  RepulsionConfig& repulsion = config->repulsion;
  SelfCollisionConfig& self = config->self_collision;
  return {
      row("query/tolerance", &query.tolerance, kShort,
          "Largest difference between distance and lower_bound; 0: exact. Larger is faster.", 0.05),
      row("query/deadline", &query.deadline, {"s", -1.0, 10.0},
          "A cycle ends by then, with wider bounds; negative: a share of the period; 0: none.",
          0.05),
      row("query/margin", &query.margin, kShort,
          "Taken off every lower_bound, for sensor noise, calibration and latency.", 0.2),
      row("repulsion/influence_distance", &repulsion.influence_distance, Range::positive("m", 1e3),
          "From this distance on, repulsion is zero. At most ~max_distance.", kToMaxDistance),
      row("repulsion/gain", &repulsion.gain, Range::non_negative("", 1e6),
          "Length of the repulsion vector at touch and in contact.", 5.0),
      row("repulsion/smoothing", &repulsion.smoothing, Range::positive("m", 10.0),
          "Obstacles this much farther than the nearest one still push. Larger is smoother.", 0.5),
      row("penetration/enabled", choice(&config->contacts_wanted, {"auto", "true", "false"}),
          "Links with a contact wrench; auto: those within repulsion/influence_distance so far."),
      row("self_collision/enabled", &self.enabled,
          "Distances from link to link, on ~self_proximity."),
      row("self_collision/in_minimum", &self.in_minimum,
          "They count in ~min_distance, ~speed_scale and ~joint_repulsion."),
      row("joint_deceleration/default", &config->deceleration.other,
          Range::non_negative("rad/s^2 or m/s^2", 1e3),
          "With how much joints brake at least; robot_future follows. 0: not known. Or by joint: "
          "{default: 5, joint_1: 3}.",
          Parameter::kStartOnly, true),
      row("trajectory/obstacle_speed", &config->trajectory.obstacle_speed,
          Range::non_negative("m/s", 100.0), "Obstacles may come this fast; 0: they stand still."),
      row("trajectory/cancel_topic", &config->trajectory.cancel_topic,
          "Of an action whose goals are cancelled when braking is due or nothing is known."),
      row("unknown_space", choice(&config->unknown_space, {"free", "obstacle", "report"}),
          "Space that no memory knows: obstacle: it counts in lower_bound; report: its share is "
          "told."),
  };
}

std::vector<Parameter> speed_scale_parameters(ServerConfig* config) {
  SpeedScaleConfig& speed = config->speed_scale;
  SeparationConfig& separation = speed.separation;
  const Range time = Range::non_negative("s", 100.0);
  std::vector<Parameter> table = {
      row("speed_scale/enabled", &config->speed_scale_enabled,
          "Publish ~speed_scale, the share of its speed at which the robot may go."),
      row("speed_scale/stop_distance", &speed.stop_distance, kLength,
          "At this lower_bound and below, the scale is 0. Also: links/NAME/stop_distance.",
          kToMaxDistance),
      row("speed_scale/free_distance", &speed.free_distance, kLength,
          "From this lower_bound on, the scale is 1. Also: links/NAME/free_distance.",
          kToMaxDistance),
      row("speed_scale/hysteresis", &speed.hysteresis, kLength,
          "The scale rises only when the bound has risen by this much.", 0.1),
      row("speed_scale/separation/enabled", &separation.enabled, {"", 0.0, 1.0},
          "Whether the separation distance of ISO 13855:2024 decides as well.", 1.0),
      row("speed_scale/separation/obstacle_speed", &separation.obstacle_speed,
          Range::non_negative("m/s", 100.0), "Obstacles are taken to come at least this fast.",
          5.0),
      row("speed_scale/separation/robot_speed", &separation.robot_speed, {"m/s", 1e-3, 100.0},
          "Speed of the robot's fastest point at scale 1.", 5.0),
      row("speed_scale/separation/reaction_time", &separation.reaction_time, time,
          "Time from the scale to drives that brake.", 2.0),
      row("speed_scale/separation/stopping_time", &separation.stopping_time, time,
          "Time in which the robot stops from robot_speed.", 2.0),
  };
  for (LinkSpeedDistances& link : speed.links) {
    const std::string at = "speed_scale/links/" + link.link + "/";
    for (const auto& [name, value] : {std::pair("stop_distance", &link.stop_distance),
                                      std::pair("free_distance", &link.free_distance)}) {
      if (!std::isnan(*value)) table.push_back({at + name, value, kLength, "", kToMaxDistance});
    }
  }
  return table;
}

/// The models of noise that are published.
Choice sensor_choice(ExtentConfig* extent) {
  std::vector<std::string> names = {"none"};
  for (const SensorModel& model : sensor_models()) names.emplace_back(model.name);
  const auto set = [names, extent](std::size_t i) {
    const SensorModel* model = find_sensor_model(names[i]);
    if (model == nullptr) return;
    extent->noise_constant = model->noise_constant;
    extent->noise_quadratic = model->noise_quadratic;
    extent->calibration = model->calibration;
    extent->calibration_angle = model->calibration_angle;
    extent->field_of_view = model->field_of_view;
  };
  return {names, set};
}

WordOr footprint_choice(ExtentConfig* extent) {
  using Footprint = ExtentConfig::Footprint;
  const auto set = [extent](std::size_t i) {
    extent->footprint = i == 0 ? Footprint::kNone : Footprint::kCamera;
  };
  const auto note_angle = [extent] { extent->footprint = Footprint::kAngle; };
  return {{{"none", "camera"}, set}, &extent->footprint_angle, note_angle};
}

/// The points of sensors: ranges, self-filter, extent.
std::vector<Parameter> sensor_parameters(const std::string& at, SourceConfig* source) {
  IngestConfig& ingest = source->ingest;
  ExtentConfig& extent = ingest.extent;
  return {
      row(at + "min_range", &ingest.min_range, Range::non_negative("m", 1e4),
          "Points nearer to the sensor are left out."),
      row(at + "max_range", &ingest.max_range, Range::positive("m", kInfinity, true),
          "Points farther from the sensor are left out."),
      row(at + "frozen_after", &source->frozen_after, kTime,
          "The same bytes for longer are STALE_CLOUD; .inf: never."),
      row(at + "self_filter", &ingest.self_filter, "Drop points that lie on the robot."),
      row(at + "self_filter_mode", choice(&ingest.self_filter_mode, {"padding", "view"}),
          "view keeps what touches the robot (doc/sources.md)."),
      row(at + "self_filter_padding/default", &source->other_padding, kShort,
          "How near to the robot. Or by link: {default: 0.02, gripper_link: 0.04}.",
          Parameter::kStartOnly, true),
      row(at + "noise/sensor", sensor_choice(&extent),
          "Its published noise; what follows replaces a part. Or noise: kinect_v1.", true),
      row(at + "noise/a", &extent.noise_constant, kShort,
          "A range's standard deviation is a + b range^2; three of them belong to a point."),
      row(at + "noise/b", &extent.noise_quadratic, Range::non_negative("1/m", 1.0), ""),
      row(at + "noise/calibration", &extent.calibration, kShort,
          "Error of its pose and ranges; half the diagonal of a voxel filter, too."),
      row(at + "footprint", footprint_choice(&extent), Range::non_negative("rad", 0.5),
          "The surface between points: camera, by the camera_info or the scan; or their angle."),
      row(at + "latency", &extent.latency, Range::non_negative("s", 10.0),
          "From measurement to stamp; obstacles move at 1.6 m/s, as a walking person."),
  };
}

/// The rows of clouds and depth images alone. 10^9 voxels of a memory take 8.6 GB.
std::vector<Parameter> image_parameters(const std::string& at, SourceConfig* source) {
  SourceMemoryConfig& memory = source->memory;
  return {
      row(at + "noise_filter/radius", &source->noise.radius, kShort,
          "Drop points of clouds and images with fewer than 4 neighbors in this distance; 0: "
          "none."),
      row(at + "memory/enabled", &memory.enabled,
          "What left the view of a cloud or image stays as boxes of a source NAME/memory."),
      row(at + "memory/decay", &memory.map.decay, kTime,
          "What was measured longer ago is forgotten; .inf: never."),
      row(at + "memory/resolution", &memory.map.resolution, {"m", 0.001, 1.0}, "Edge of a voxel."),
      row(at + "memory/max_nodes", &memory.map.max_nodes, {"", 4096.0, 1e9},
          "Voxels that there is memory for, 8.6 bytes each; the oldest go first."),
      row(at + "memory/file", Path{&memory.file},
          "Absolute path of a .bt file: read at the start, written by ~save_memory."),
  };
}

/// The rows of maps and known worlds. A map has no sensor from which ranges count.
std::vector<Parameter> map_parameters(const std::string& at, SourceConfig* source) {
  ExtentConfig& extent = source->ingest.extent;
  return {
      row(at + "file", Path{&source->file},
          "Absolute path of a .bt or .ot file, in place of the topic."),
      row(at + "frame_id", &source->frame_id, "The file's frame."),
      row(at + "noise/a", &extent.noise_constant, kShort),
      row(at + "noise/calibration", &extent.calibration, kShort),
      row(at + "latency", &extent.latency, Range::non_negative("s", 10.0)),
  };
}

std::vector<Parameter> world_parameters(const std::string& at, SourceConfig* source) {
  WorldConfig& world = source->world;
  OtherRobotConfig& robot = world.robot;
  return {
      row(at + "file", Path{&source->file}, "Absolute path of a MoveIt scene, if any."),
      row(at + "frame_id", &world.frame_id,
          "Frame of objects that state none. Default: the fixed frame."),
      row(at + "robot/description", &robot.description,
          "Name of the parameter with another robot's URDF, if any."),
      row(at + "robot/tf_prefix", &robot.tf_prefix,
          "Its links' frames in tf are this and the link's name."),
      row(at + "robot/joint_states", &robot.joint_states,
          "Its topic. Default: the poses of its links come from tf."),
      row(at + "margin", &world.margin, kMargin, "Of objects that state none."),
      row(at + "allowed_contacts", &world.allowed_contacts,
          "Pairs of a link and an object that may touch, [[base_link, table]]."),
  };
}

}  // namespace

std::vector<Parameter> node_parameters(ServerConfig* config) {
  std::vector<Parameter> table = model_and_pose_parameters(config);
  append(answer_parameters(config), &table);
  append(speed_scale_parameters(config), &table);
  return table;
}

std::vector<Parameter> live_parameters(ServerConfig* config) {
  std::vector<Parameter> table = node_parameters(config);
  const auto is_fixed = [](const Parameter& row) { return !row.is_live(); };
  table.erase(std::remove_if(table.begin(), table.end(), is_fixed), table.end());
  return table;
}

std::vector<Parameter> source_parameters(const std::string& at, SourceConfig* source) {
  const SourceType type = source->type;
  const char* const timeout_help = "Older messages are STALE_CLOUD; .inf: never.";
  std::vector<Parameter> table;
  if (at.empty()) {
    table = {row("cloud_timeout", &source->timeout, kTime, timeout_help)};
  } else {
    std::vector<std::string> types(static_cast<std::size_t>(SourceType::kWorld) + 1, "world");
    for (std::size_t i = 0; i + 1 < types.size(); ++i) {
      types[i] = message_type(static_cast<SourceType>(i));
    }
    table = {
        row(at + "type", choice(&source->type, types), ""),
        row(at + "topic", &source->topic, "A relative name, can be remapped."),
        row(at + "timeout", &source->timeout, kTime, timeout_help),
        row(at + "required", &source->required,
            "false: its absence shows in its own status only, while another source measures.")};
  }
  if (type == SourceType::kDepthImage) {
    append({row(at + "camera_info", &source->camera_info,
                "Topic of its sensor_msgs/CameraInfo. Default: camera_info beside topic."),
            row(at + "depth_scale", &source->depth_unit, {"m", 0.0, 1.0},
                "Of a number of 1; 0: that of the encoding.")},
           &table);
  }
  if (type == SourceType::kMap) {
    append(map_parameters(at, source), &table);
  } else if (type == SourceType::kWorld) {
    append(world_parameters(at, source), &table);
  } else {
    append(sensor_parameters(at, source), &table);
    if (type != SourceType::kScan) append(image_parameters(at, source), &table);
  }
  return table;
}

const std::vector<std::string> WrittenObject::kShapes = {"box",  "sphere", "cylinder",
                                                         "cone", "plane",  "mesh"};

std::vector<Parameter> object_parameters(const std::string& at, WrittenObject* written,
                                         WorldObjectConfig* config) {
  WorldObject& object = config->object;
  const Range position{"m", -kMaxLength, kMaxLength}, scale{"", -kMaxScale, kMaxScale};
  std::vector<Parameter> table = {row(
      at + "shape", choice(&written->shape, WrittenObject::kShapes),
      "sphere: radius: 0.1; cylinder, cone: length: 1, too; mesh: mesh: URI, scale: [1, 1, 1].")};
  const std::string shape =
      written->shape < WrittenObject::kShapes.size() ? WrittenObject::kShapes[written->shape] : "";
  if (shape == "box") {
    table.push_back(row(at + "size", &written->size, kSize, "Along x, y and z."));
  } else if (shape == "mesh") {
    append({row(at + "mesh", &config->mesh, ""), row(at + "scale", &config->scale, scale)}, &table);
  } else if (shape != "plane" && !shape.empty()) {
    table.push_back(row(at + "radius", &written->radius, kSize));
    if (shape != "sphere") table.push_back(row(at + "length", &written->length, kSize));
  }
  append({row(at + "frame_id", &object.frame, "Default: that of the source."),
          row(at + "position", &written->position, position),
          row(at + "rpy", &written->rpy, {"rad", -100.0, 100.0}, "Roll, pitch and yaw."),
          row(at + "margin", &object.margin, kMargin)},  // the last one: zones have none
         &table);
  return table;
}

}  // namespace ist
