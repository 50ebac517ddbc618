#include "ros/parameters/parameters.h"

#include <ros/console.h>
#include <ros/master.h>
#include <ros/param.h>

#include "internal/packing/packing_cache.h"
#include "ros/common/frame_name.h"
#include "ros/common/text.h"
#include "ros/parameters/parameter_reader.h"
#include "ros/parameters/source_parameters.h"
#include "ros/parameters/speed_scale_parameters.h"

namespace ist {
namespace {

bool read_repulsion(ParameterReader* reader, double max_distance, RepulsionConfig* repulsion) {
  reader->read("repulsion/influence_distance", Range::positive("m", 1e3),
               &repulsion->influence_distance);
  reader->read("repulsion/gain", Range::non_negative("", 1e6), &repulsion->gain);
  reader->read("repulsion/smoothing", Range::positive("m", 10.0), &repulsion->smoothing);
  reader->read("repulsion/filter_time", Range::non_negative("s", 10.0), &repulsion->filter_time);
  const bool clamped = repulsion->influence_distance > max_distance;
  if (clamped) repulsion->influence_distance = max_distance;
  return clamped && reader->has("repulsion/influence_distance");
}

void read_poses(ParameterReader* reader, ServerConfig* config) {
  reader->read("fixed_frame", &config->fixed_frame);
  std::string pose_source = "tf";
  reader->read_choice("pose_source", {"tf", "joint_states"}, &pose_source);
  config->pose_source = pose_source == "tf" ? PoseSourceKind::kTf : PoseSourceKind::kJointStates;
  reader->read("pose_timeout", Range::positive("s", 3600.0), &config->pose_timeout);
  reader->read("joint_lag", Range::non_negative("s", 3600.0), &config->joint_lag);
  reader->read("rate", Range{"Hz", 0.01, 1000.0}, &config->rate);
}

void read_model(ParameterReader* reader, ServerConfig* config) {
  reader->read("robot_description", &config->robot_description);
  if (config->robot_description.empty()) {
    reader->add_error("~robot_description is empty: the name of the parameter with the URDF");
  } else if (config->robot_description.find('<') != std::string::npos) {
    reader->add_error(
        "~robot_description holds a URDF: it must be the name of the parameter that holds it; set "
        "'robot_description' outside of the node, in its namespace or above");
  }
  std::string geometry = "collision";
  reader->read_choice("geometry", {"collision", "visual"}, &geometry);
  config->geometry = geometry == "visual" ? GeometrySource::kVisual : GeometrySource::kCollision;
  reader->read("links", &config->model.links);
  reader->read("packing/max_error", Range::positive("m", 1.0), &config->model.packing.max_error);
  reader->read("packing/max_spheres", Range{"", 1.0, 1e6}, &config->model.packing.max_spheres);
  reader->read("packing/threads", Range::non_negative("", 256), &config->model.threads);
  config->model.cache_directory = default_cache_directory();
  reader->read("cache_directory", &config->model.cache_directory);
  const std::string& cache = config->model.cache_directory;
  if (!cache.empty() && cache[0] != '/' && reader->has("cache_directory")) {
    reader->add_error("~cache_directory is \"" + cache +
                      "\": an absolute path is needed, or an empty one for no cache");
  }
}

void read_query(ParameterReader* reader, QueryConfig* query) {
  reader->read("query/tolerance", Range::non_negative("m", 1.0), &query->tolerance);
  // The range is from the whole period to 10 s.
  reader->read("query/deadline", Range{"s", -1.0, 10.0}, &query->deadline);
  reader->read("query/margin", Range::non_negative("m", 1.0), &query->margin);
}

void read_penetration(ParameterReader* reader, PenetrationConfig* penetration) {
  reader->read("penetration/stiffness", Range::non_negative("N/m^3", 1e12),
               &penetration->stiffness);
}

void read_contacts(ParameterReader* reader, ServerConfig* config) {
  std::string wanted = "auto";
  reader->read_switch("penetration/enabled", &wanted);
  config->contacts_wanted = wanted == "true"    ? ContactsWanted::kAll
                            : wanted == "false" ? ContactsWanted::kNone
                                                : ContactsWanted::kAuto;
  reader->read("penetration/max_error", Range::positive("m", 1.0),
               &config->contacts.packing.max_error);
  reader->read("penetration/max_spheres", Range{"", 1.0, 1e5},
               &config->contacts.packing.max_spheres);
  read_penetration(reader, &config->penetration);
}

void read_self_collision(ParameterReader* reader, SelfCollisionConfig* config) {
  reader->read("self_collision/enabled", &config->enabled);
  reader->read("self_collision/rate", Range{"Hz", 0.01, 1000.0}, &config->rate);
  reader->read("self_collision/ignore", &config->ignore);
  reader->read("self_collision/ignore_contact_at_rest", &config->ignore_contact_at_rest);
  reader->read("self_collision/in_minimum", &config->in_minimum);
  reader->read("self_collision/samples", Range::non_negative("", 1e6), &config->samples);
}

void read_attach(ParameterReader* reader, AttachConfig* config) {
  reader->read("attach/max_objects", Range::non_negative("", 1e4), &config->max_objects);
  reader->read("attach/max_time", Range::positive("s", 3600.0), &config->max_time);
}

void read_unknown_space(ParameterReader* reader, ServerConfig* config) {
  std::string text = "free";
  reader->read_choice("unknown_space", {"free", "obstacle", "report"}, &text);
  config->unknown_space = text == "obstacle" ? UnknownSpace::kObstacle
                          : text == "report" ? UnknownSpace::kReport
                                             : UnknownSpace::kFree;
  if (config->unknown_space == UnknownSpace::kFree) return;
  const SourceMemoryConfig* first = nullptr;
  for (const SourceConfig& source : config->sources) {
    const SourceMemoryConfig& memory = source.memory;
    if (!memory.enabled) continue;
    if (first == nullptr) first = &memory;
    if (!source.ingest.self_filter) {
      reader->add_error("~unknown_space is " + text + ": it needs to know where the robot is; '" +
                        source.name + "' has self_filter: false");
    }
    if (memory.map.resolution != first->map.resolution || memory.frame_id != first->frame_id) {
      reader->add_error("~unknown_space is " + text +
                        ": the memories of all sources need the same "
                        "resolution and frame_id then; '" +
                        source.name + "' has others");
    }
  }
  if (first == nullptr) {
    reader->add_error("~unknown_space is " + text +
                      ": a memory says what has been seen; set ~memory/enabled");
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

ServerConfig parse_parameters(const XmlRpc::XmlRpcValue& tree, std::vector<std::string>* warnings) {
  ParameterReader reader(tree);
  ServerConfig config;
  for (const char* group : {"query", "repulsion", "penetration", "packing", "self_collision",
                            "attach", "min_distance", "speed_scale"}) {
    reader.children(group);  // adds an error unless it is a dictionary
  }
  read_poses(&reader, &config);
  read_model(&reader, &config);
  reader.read("max_distance", Range::positive("m", 1e3), &config.query.max_distance);
  read_query(&reader, &config.query);
  reader.read("query/max_answers", Range{"", 1.0, 1e7}, &config.max_query_answers);
  if (read_repulsion(&reader, config.query.max_distance, &config.repulsion)) {
    warnings->push_back(
        "~repulsion/influence_distance is more than ~max_distance, and nothing farther "
        "away is measured; ~max_distance is used");
  }
  read_contacts(&reader, &config);
  config.sources = read_sources(&reader);
  for (SourceConfig& source : config.sources) {
    source.ingest.search_distance = config.query.max_distance;
  }
  read_unknown_space(&reader, &config);
  read_self_collision(&reader, &config.self_collision);
  read_attach(&reader, &config.attach);
  if (config.self_collision.in_minimum && !config.self_collision.enabled) {
    warnings->push_back("~self_collision/in_minimum has no effect without ~self_collision/enabled");
  }
  reader.read("ignore_links", &config.ignore_links);
  reader.read("min_distance/fixed_links", &config.fixed_links_count);
  reader.read("speed_scale/enabled", &config.speed_scale_enabled);
  config.speed_scale = read_speed_scale(&reader, config.query.max_distance);

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
  for (const char* group : {"query", "repulsion", "penetration"}) {
    reader.children(group);  // adds an error unless it is a dictionary
  }
  read_query(&reader, &reading.config.query);
  read_repulsion(&reader, last.query.max_distance, &reading.config.repulsion);
  read_penetration(&reader, &reading.config.penetration);
  reading.tunables = reader.tunables();
  reading.errors = reader.errors();
  read_live_speed_scale(tree, last.query.max_distance, &reading);
  for (const Tunable& tunable : reading.tunables) reading.found.push_back(reader.has(tunable.name));
  return reading;
}

}  // namespace ist
