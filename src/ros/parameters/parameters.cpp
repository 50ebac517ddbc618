#include "ros/parameters/parameters.h"

#include <ros/console.h>
#include <ros/master.h>
#include <ros/param.h>

#include <algorithm>
#include <cmath>

#include "internal/packing/packing_cache.h"
#include "ros/common/frame_name.h"
#include "ros/common/text.h"
#include "ros/parameters/parameter_reader.h"
#include "ros/parameters/source_parameters.h"

namespace ist {
namespace {

constexpr char kSpeedScale[] = "~speed_scale/";

/// The two distances that a link may have of its own.
struct OwnDistance {
  const char* name;
  double LinkSpeedDistances::*value;
};
constexpr OwnDistance kOwnDistances[] = {{"stop_distance", &LinkSpeedDistances::stop_distance},
                                         {"free_distance", &LinkSpeedDistances::free_distance}};

std::string path_of(const std::string& link, const OwnDistance& own) {
  return "speed_scale/links/" + link + "/" + own.name;
}

/// The table of what is read at the start only; ~sources has tables of its own.
std::vector<Parameter> startup_parameters(ServerConfig* config) {
  SelfCollisionConfig& self = config->self_collision;
  const Range rate{"Hz", 0.01, 1000.0};
  return {
      {"robot_description", &config->robot_description},
      {"fixed_frame", &config->fixed_frame},
      {"pose_source", choice(&config->pose_source, {"tf", "joint_states"})},
      {"rate", &config->rate, rate},
      {"pose_timeout", &config->pose_timeout, Range::positive("s", 3600.0)},
      {"links", &config->model.links},
      {"ignore_links", &config->ignore_links},
      {"min_distance/fixed_links", &config->fixed_links_count},
      {"geometry", choice(&config->geometry, {"collision", "visual"})},
      {"max_distance", &config->query.max_distance, Range::positive("m", 1e3)},
      {"packing/max_error", &config->model.packing.max_error, Range::positive("m", 1.0)},
      {"packing/max_spheres", &config->model.packing.max_spheres, {"", 1.0, 1e6}},
      {"penetration/enabled", choice(&config->contacts_wanted, {"auto", "true", "false"})},
      {"speed_scale/enabled", &config->speed_scale_enabled},
      {"self_collision/enabled", &self.enabled},
      {"self_collision/rate", &self.rate, rate},
      {"self_collision/ignore", &self.ignore},
      {"self_collision/ignore_contact_at_rest", &self.ignore_contact_at_rest},
      {"self_collision/in_minimum", &self.in_minimum},
      {"attach/max_objects", &config->attach.max_objects, Range::non_negative("", 1e4)},
      {"attach/max_time", &config->attach.max_time, Range::positive("s", 3600.0)},
      {"trajectory/tolerance", &config->trajectory.tolerance, Range::positive("rad or m", 10.0)},
      {"trajectory/deceleration", &config->trajectory.deceleration,
       Range::non_negative("rad/s^2 or m/s^2", 1e3)},
      {"trajectory/obstacle_speed", &config->trajectory.obstacle_speed,
       Range::non_negative("m/s", 100.0)},
      {"trajectory/cancel_topic", &config->trajectory.cancel_topic},
      {"unknown_space", choice(&config->unknown_space, {"free", "obstacle", "report"})},
      {"cache_directory", &config->model.cache_directory},
  };
}

/// Nothing farther away than max_distance is measured.
/// @returns whether the influence distance was more
bool limit_influence(LiveConfig* config) {
  double& influence = config->repulsion.influence_distance;
  const bool is_more = influence > config->query.max_distance;
  if (is_more) influence = config->query.max_distance;
  return is_more;
}

/// One of two words, or the names of links.
void read_filter_links(ParameterReader* reader, ServerConfig* config) {
  const std::string name = "self_filter_links";
  if (reader->type(name) == XmlRpc::XmlRpcValue::TypeString) {
    reader->read({name, choice(&config->self_filter_all, {"monitored", "all"})});
  } else {
    reader->read({name, &config->self_filter_links});
  }
}

void check_model(ParameterReader* reader, const ServerConfig& config) {
  if (config.robot_description.empty()) {
    reader->add_error("robot_description", "is empty: the name of the parameter with the URDF");
  } else if (config.robot_description.find('<') != std::string::npos) {
    reader->add_error("robot_description",
                      "holds a URDF: it must be the name of the parameter that holds it; set "
                      "'robot_description' outside of the node, in its namespace or above");
  }
  const std::string& cache = config.model.cache_directory;
  if (!cache.empty() && cache[0] != '/' && reader->has("cache_directory")) {
    reader->add_error("cache_directory", "is \"" + cache +
                                             "\": an absolute path is needed, or an empty one for "
                                             "no cache");
  }
}

/// The speed scale before its parameters are read. Distances that are not set fit a max_distance
/// below them; links have the robot's where one of their own is set, until it is read.
SpeedScaleConfig unread_speed_scale(ParameterReader* reader, double max_distance) {
  const bool has_free = reader->has("speed_scale/free_distance");
  SpeedScaleConfig config = fitted_to({}, max_distance);
  if (has_free || reader->has("speed_scale/stop_distance")) {
    const SpeedScaleConfig usual;
    config.stop_distance = usual.stop_distance;
    // The one that is not set stays in its place relative to the other.
    config.free_distance =
        has_free ? usual.free_distance : std::min(usual.free_distance, max_distance);
  }
  for (const std::string& name : reader->children("speed_scale/links")) {
    LinkSpeedDistances link;
    link.link = name;
    reader->children("speed_scale/links/" + name);  // adds an error unless it is a dictionary
    for (const OwnDistance& own : kOwnDistances) {
      if (reader->has(path_of(name, own))) link.*own.value = config.stop_distance;
    }
    config.links.push_back(link);
  }
  return config;
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

void refuse_new_distances(ParameterReader* reader, const std::vector<Parameter>& table) {
  for (const std::string& link : reader->children("speed_scale/links")) {
    for (const OwnDistance& own : kOwnDistances) {
      const std::string path = path_of(link, own);
      const auto is_this = [&path](const Parameter& one) { return one.name == path; };
      if (reader->has(path) && std::none_of(table.begin(), table.end(), is_this)) {
        reader->add_error(path, "was not set at the start: restart the node to use it");
      }
    }
  }
}

/// Unknown space needs memories that fit together.
void check_unknown_space(ParameterReader* reader, const ServerConfig& config) {
  if (config.unknown_space == UnknownSpace::kFree) return;
  const std::string is =
      config.unknown_space == UnknownSpace::kObstacle ? "is obstacle: " : "is report: ";
  const SourceMemoryConfig* first = nullptr;
  for (const SourceConfig& source : config.sources) {
    const SourceMemoryConfig& memory = source.memory;
    if (!memory.enabled) continue;
    if (first == nullptr) first = &memory;
    if (!source.ingest.self_filter) {
      reader->add_error("unknown_space", is + "it needs to know where the robot is; '" +
                                             source.name + "' has self_filter: false");
    }
    if (memory.map.resolution != first->map.resolution || memory.frame_id != first->frame_id) {
      reader->add_error("unknown_space",
                        is +
                            "the memories of all sources need the same resolution and frame_id "
                            "then; '" +
                            source.name + "' has others");
    }
  }
  if (first == nullptr) {
    reader->add_error("unknown_space",
                      is + "a memory says what has been seen; set ~memory/enabled");
  }
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

QueryConfig default_query() {
  QueryConfig query;
  query.deadline = kDefaultDeadline;
  return query;
}

double deadline_of(double parameter, double period) {
  return parameter < 0.0 ? -parameter * period : parameter;
}

std::vector<Parameter> live_parameters(LiveConfig* config) {
  // Sliders end where robots and cameras need them to, so that a pixel means something. The ranges
  // that a parameter accepts are much wider.
  QueryConfig& query = config->query;
  RepulsionConfig& repulsion = config->repulsion;
  SpeedScaleConfig& speed = config->speed_scale;
  SeparationConfig& separation = speed.separation;
  const Range length = Range::non_negative("m", 1e3), time = Range::non_negative("s", 100.0);
  const Range short_length = Range::non_negative("m", 1.0);
  std::vector<Parameter> table = {
      {"query/tolerance", &query.tolerance, short_length, 0.05,
       "Largest difference between distance and lower_bound; 0: exact. Larger is faster."},
      {"query/deadline",
       &query.deadline,
       {"s", -1.0, 10.0},
       0.05,
       "Time after which a query ends with wider bounds; negative: a share of the period; 0: "
       "none."},
      {"query/margin", &query.margin, short_length, 0.2,
       "Taken off every lower_bound, for sensor noise, calibration and latency."},
      {"repulsion/influence_distance", &repulsion.influence_distance, Range::positive("m", 1e3),
       0.0, "From this distance on, repulsion is zero. At most ~max_distance."},
      {"repulsion/gain", &repulsion.gain, Range::non_negative("", 1e6), 5.0,
       "Length of the repulsion vector at touch and in contact."},
      {"repulsion/smoothing", &repulsion.smoothing, Range::positive("m", 10.0), 0.5,
       "Obstacles this much farther than the nearest one still push. Larger is smoother."},
      {"repulsion/filter_time", &repulsion.filter_time, Range::non_negative("s", 10.0), 1.0,
       "Mean delay of the change that a new cloud brings; 0: none."},
      {"penetration/stiffness", &config->penetration.stiffness, Range::non_negative("N/m^3", 1e12),
       1e6, "Contact force per volume that link and obstacle share."},
      {"speed_scale/stop_distance", &speed.stop_distance, length, 0.0,
       "At this lower_bound and below, the speed scale is 0."},
      {"speed_scale/free_distance", &speed.free_distance, length, 0.0,
       "From this lower_bound on, the speed scale is 1."},
      {"speed_scale/hysteresis", &speed.hysteresis, length, 0.1,
       "The scale rises only when the bound has risen by this much."},
      {"speed_scale/slow_distance", &speed.slow_distance, length, 0.0,
       "At this lower_bound the scale is slow_scale; 0: a straight line."},
      {"speed_scale/slow_scale",
       &speed.slow_scale,
       {"", 0.0, 1.0},
       1.0,
       "The scale at slow_distance."},
      {"speed_scale/self_stop_distance", &speed.self_stop_distance, length, 0.0,
       "At this distance from link to link the scale is 0."},
      {"speed_scale/self_free_distance", &speed.self_free_distance, length, 0.0,
       "At this distance from link to link, and farther, it is 1."},
      {"speed_scale/separation/enabled",
       &separation.enabled,
       {"", 0.0, 1.0},
       1.0,
       "Whether the separation distance decides as well."},
      {"speed_scale/separation/obstacle_speed", &separation.obstacle_speed,
       Range::non_negative("m/s", 100.0), 5.0, "Obstacles are taken to come at least this fast."},
      {"speed_scale/separation/robot_speed",
       &separation.robot_speed,
       {"m/s", 1e-3, 100.0},
       5.0,
       "Speed of the robot's fastest point at scale 1."},
      {"speed_scale/separation/reaction_time", &separation.reaction_time, time, 2.0,
       "Time from the scale to drives that brake."},
      {"speed_scale/separation/stopping_time", &separation.stopping_time, time, 2.0,
       "Time in which the robot stops from robot_speed."},
      {"speed_scale/separation/intrusion", &separation.intrusion, length, 1.0,
       "How far a part may reach past the sensor unseen."},
      {"speed_scale/separation/uncertainty", &separation.uncertainty, length, 0.5,
       "Uncertainty of positions besides query/margin."},
  };
  for (LinkSpeedDistances& link : speed.links) {
    for (const OwnDistance& own : kOwnDistances) {
      if (std::isnan(link.*own.value)) continue;
      table.push_back({path_of(link.link, own), &(link.*own.value), length});
    }
  }
  return table;
}

ServerConfig parse_parameters(const XmlRpc::XmlRpcValue& tree, std::vector<std::string>* warnings) {
  ParameterReader reader(tree);
  ServerConfig config;
  config.model.cache_directory = default_cache_directory();
  reader.read_all(startup_parameters(&config));
  read_filter_links(&reader, &config);
  check_model(&reader, config);
  config.speed_scale = unread_speed_scale(&reader, config.query.max_distance);
  reader.read_all(live_parameters(&config));
  check_speed_scale(&reader, config);
  if (limit_influence(&config) && reader.has("repulsion/influence_distance")) {
    warnings->push_back(
        "~repulsion/influence_distance is more than ~max_distance, and nothing farther "
        "away is measured; ~max_distance is used");
  }
  config.sources = read_sources(&reader);
  for (SourceConfig& source : config.sources) {
    source.ingest.search_distance = config.query.max_distance;
  }
  check_unknown_space(&reader, config);
  if (!config.trajectory.cancel_topic.empty() && config.trajectory.deceleration == 0.0) {
    reader.add_error("trajectory/cancel_topic",
                     "needs ~trajectory/deceleration: nobody knows when braking is due without it");
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

LiveReading parse_live(const XmlRpc::XmlRpcValue& tree, const LiveConfig& last) {
  ParameterReader reader(tree);
  LiveReading reading;
  reading.config = last;
  const std::vector<Parameter> table = live_parameters(&reading.config);
  reader.read_all(table);
  for (const Parameter& parameter : table) reading.found.push_back(reader.has(parameter.name));
  refuse_new_distances(&reader, table);
  limit_influence(&reading.config);
  const std::vector<std::string> conflicts =
      config_errors(reading.config.speed_scale, kSpeedScale, last.query.max_distance);
  if (!conflicts.empty()) reading.config.speed_scale = last.speed_scale;
  reading.errors = reader.errors();
  reading.errors.insert(reading.errors.end(), conflicts.begin(), conflicts.end());
  return reading;
}

}  // namespace ist
