#include "ros/parameters/parameters.h"

#include <ros/console.h>
#include <ros/master.h>
#include <ros/param.h>

#include <algorithm>

#include "internal/packing/packing_cache.h"
#include "ros/common/frame_name.h"
#include "ros/common/text.h"
#include "ros/parameters/parameter_reader.h"
#include "ros/parameters/parameter_table.h"

namespace ist {
namespace {

constexpr char kSpeedScale[] = "~speed_scale/";

/// Nothing farther away than max_distance is measured.
/// @returns whether the influence distance was more
bool limit_influence(LiveConfig* config) {
  double& influence = config->repulsion.influence_distance;
  const bool is_more = influence > config->query.max_distance;
  if (is_more) influence = config->query.max_distance;
  return is_more;
}

void check_model(ParameterReader* reader, const ServerConfig& config) {
  if (config.robot_description.empty()) {
    reader->add_error("robot_description", "is empty: the name of the parameter with the URDF");
  } else if (config.robot_description.find('<') != std::string::npos) {
    reader->add_error("robot_description",
                      "holds a URDF: it must be the name of the parameter that holds it; set "
                      "'robot_description' outside of the node, in its namespace or above");
  }
}

/// Adds the links that have a distance of their own; those are read afterwards.
void find_links_with_distances(ParameterReader* reader, SpeedScaleConfig* config) {
  const auto unread = [reader](const std::string& name) {
    return reader->has(name) ? 0.0 : LinkSpeedDistances::kAsRobot;
  };
  for (const std::string& name : reader->children("speed_scale/links")) {
    const std::string at = "speed_scale/links/" + name;
    reader->children(at);  // adds an error unless it is a dictionary
    config->links.push_back({name, unread(at + "/stop_distance"), unread(at + "/free_distance")});
  }
}

/// Makes distances that are not set fit a max_distance below them, in proportion where neither is.
void fit_speed_scale(const ParameterReader& reader, double max_distance, SpeedScaleConfig* config) {
  const SpeedScaleConfig fitted = fitted_to(*config, max_distance);
  config->self_stop_distance = fitted.self_stop_distance;
  config->self_free_distance = fitted.self_free_distance;
  if (reader.has("speed_scale/free_distance")) return;
  config->free_distance = fitted.free_distance;
  if (!reader.has("speed_scale/stop_distance")) config->stop_distance = fitted.stop_distance;
}

void check_speed_scale(ParameterReader* reader, const ServerConfig& config) {
  const auto is_of_it = [](const std::string& error) {
    return error.rfind("~speed_scale", 0) == 0;
  };
  const std::vector<std::string>& told = reader->errors();
  if (std::any_of(told.begin(), told.end(), is_of_it)) return;
  for (const std::string& error :
       config_errors(config.speed_scale, kSpeedScale, config.query.max_distance)) {
    reader->add_error(error);
  }
}

/// Unknown space needs memories that fit together.
void check_unknown_space(ParameterReader* reader, const ServerConfig& config) {
  if (config.unknown_space == UnknownSpace::kFree) return;
  const auto refuse = [&](const std::string& why) {
    const bool counts = config.unknown_space == UnknownSpace::kObstacle;
    reader->add_error("unknown_space", (counts ? "is obstacle: " : "is report: ") + why);
  };
  const SourceMemoryConfig* first = nullptr;
  for (const SourceConfig& source : config.sources) {
    const SourceMemoryConfig& memory = source.memory;
    if (!memory.enabled) continue;
    if (first == nullptr) first = &memory;
    if (!source.ingest.self_filter) {
      refuse("the robot's place is needed; '" + source.name + "' has self_filter: false");
    }
    if (memory.map.resolution != first->map.resolution) {
      refuse("all memories need the same resolution; '" + source.name + "' differs");
    }
  }
  if (first == nullptr) refuse("a memory says what has been seen; set ~memory/enabled");
}

/// A parameter needs the add-on that it is of.
void check_add_ons(ParameterReader* reader, const ServerConfig& config) {
  const std::vector<std::string>& built = built_add_ons();
  const auto check = [&](const char* add_on, const char* parameter, bool is_wanted) {
    if (!is_wanted || std::find(built.begin(), built.end(), add_on) != built.end()) return;
    reader->add_error(parameter, std::string("needs the add-on ") + add_on +
                                     ", which this node is built without: build it with CMake's "
                                     "IST_PROXIMITY_ADD_ONS=\"" +
                                     join(built, ";") + (built.empty() ? "" : ";") + add_on + '"');
  };
  check("link_pairs", "self_collision/enabled", config.self_collision.enabled);
  check("trajectory", "trajectory/cancel_topic", !config.trajectory.cancel_topic.empty());
  check("unknown_space", "unknown_space", config.unknown_space != UnknownSpace::kFree);
}

}  // namespace

std::optional<XmlRpc::XmlRpcValue> fetch_parameters(const ros::NodeHandle& private_nh) {
  XmlRpc::XmlRpcValue tree;
  if (ros::param::get(private_nh.getNamespace(), tree)) return tree;
  // False stands for "nothing is set" and for "no answer" alike.
  if (!ros::master::check()) return std::nullopt;
  // The master may have come back between the two calls, with parameters.
  if (ros::param::get(private_nh.getNamespace(), tree)) return tree;
  if (!ros::master::check()) return std::nullopt;
  return XmlRpc::XmlRpcValue();
}

std::vector<double> JointDeceleration::of(const Kinematics& kinematics) const {
  std::vector<double> result;
  for (const Kinematics::Joint& joint : kinematics.joints()) {
    const auto own = by_joint.find(joint.name);
    result.push_back(own == by_joint.end() ? other : own->second);
  }
  return result;
}

ServerConfig parse_parameters(const XmlRpc::XmlRpcValue& tree, std::vector<std::string>* warnings) {
  ParameterReader reader(tree);
  ServerConfig config;
  config.model.cache_directory = default_cache_directory();
  find_links_with_distances(&reader, &config.speed_scale);
  reader.read_all(node_parameters(&config));
  reader.read_by_name("joint_deceleration", Range::non_negative("rad/s^2 or m/s^2", 1e3),
                      &config.deceleration.by_joint);
  check_model(&reader, config);
  fit_speed_scale(reader, config.query.max_distance, &config.speed_scale);
  check_speed_scale(&reader, config);
  if (limit_influence(&config) && reader.has("repulsion/influence_distance")) {
    warnings->push_back(
        "~repulsion/influence_distance is more than ~max_distance, and nothing farther "
        "away is measured; ~max_distance is used");
  }
  config.sources = read_sources(&reader);
  config.zones = read_zones(&reader);
  for (SourceConfig& source : config.sources) {
    source.ingest.search_distance = config.query.max_distance;
  }
  check_unknown_space(&reader, config);
  check_add_ons(&reader, config);
  if (!config.trajectory.cancel_topic.empty() && !config.deceleration.is_stated()) {
    reader.add_error("trajectory/cancel_topic",
                     "needs ~joint_deceleration: nobody knows when braking is due without it");
  }
  if (config.self_collision.in_minimum && !config.self_collision.enabled) {
    warnings->push_back("~self_collision/in_minimum has no effect without ~self_collision/enabled");
  }
  if (!reader.errors().empty()) throw ParameterError(join(reader.errors(), "\n"));
  const std::vector<std::string> unknown = reader.unknown();
  warnings->insert(warnings->end(), unknown.begin(), unknown.end());
  config.fixed_frame = without_slash(config.fixed_frame);
  return config;
}

ServerConfig read_parameters(const ros::NodeHandle& private_nh) {
  std::vector<std::string> warnings;
  const std::optional<XmlRpc::XmlRpcValue> tree = fetch_parameters(private_nh);
  if (!tree) {  // the defaults would do without a configured margin
    throw ParameterError("the parameter server at " + ros::master::getURI() +
                         " does not answer: start the ROS master, then this node");
  }
  ServerConfig config = parse_parameters(*tree, &warnings);
  for (const std::string& warning : warnings) ROS_WARN_STREAM(warning);
  return config;
}

LiveReading parse_live(const XmlRpc::XmlRpcValue& tree, const ServerConfig& last) {
  ParameterReader reader(tree);
  LiveReading reading;
  reading.config = last;
  for (const Parameter& row : live_parameters(&reading.config)) {
    reader.read(row);
    if (reader.has(row.name)) reading.found.insert(row.name);
  }
  limit_influence(&reading.config);
  const std::vector<std::string> conflicts =
      config_errors(reading.config.speed_scale, kSpeedScale, last.query.max_distance);
  if (!conflicts.empty()) reading.config.speed_scale = last.speed_scale;
  reading.errors = reader.errors();
  reading.errors.insert(reading.errors.end(), conflicts.begin(), conflicts.end());
  return reading;
}

}  // namespace ist
