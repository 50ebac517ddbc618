#include "ros/parameters/parameters.h"

#include <ros/console.h>
#include <ros/param.h>

#include <cmath>
#include <limits>
#include <sstream>

#include "internal/packing/packing_cache.h"

namespace ist {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

Range more_than_zero(const char* unit, double max, bool infinite = false) {
  return {unit, 0.0, max, true, infinite};
}

Range from_zero(const char* unit, double max) { return {unit, 0.0, max, false, false}; }

void read_ingest(ParameterReader* reader, const std::string& prefix, IngestConfig* ingest) {
  const double default_max_range = ingest->max_range;
  reader->read(prefix + "min_range", from_zero("m", 1e6), &ingest->min_range);
  reader->read(prefix + "max_range", more_than_zero("m", kInf, true), &ingest->max_range);
  reader->read(prefix + "self_filter", &ingest->self_filter);
  reader->read(prefix + "self_filter_padding", from_zero("m", 1.0), &ingest->self_filter_padding);
  if (!(ingest->max_range > ingest->min_range)) {
    std::ostringstream text;
    text << "~" << prefix << "max_range is " << ingest->max_range
         << " m: it must be more than min_range, which is " << ingest->min_range << " m";
    reader->add_error(text.str());
    ingest->max_range = default_max_range;
  }
}

void read_noise(ParameterReader* reader, const std::string& prefix, NoiseFilterConfig* noise) {
  reader->read(prefix + "noise_filter/radius", from_zero("m", 1.0), &noise->radius);
  reader->read(prefix + "noise_filter/neighbors", Range{"", 1.0, 1000.0}, &noise->neighbors);
  if (noise->radius > 0.0 && !has_noise_filter()) {
    reader->add_error("~" + prefix +
                      "noise_filter/radius is set, but this build has no noise filter: it was made "
                      "without PCL (libpcl-dev)");
  }
}

void read_type(ParameterReader* reader, const std::string& prefix, SourceType* type) {
  const std::vector<SourceType> types = {SourceType::kCloud, SourceType::kScan, SourceType::kMap};
  std::vector<std::string> names;
  names.reserve(types.size());
  for (const SourceType one : types) names.emplace_back(message_type(one));
  std::string name = message_type(*type);
  reader->read_choice(prefix + "type", names, &name);
  for (const SourceType one : types) {
    if (name == message_type(one)) *type = one;
  }
}

// A map has no sensor that ranges count from, and holds no robot.
void read_map(ParameterReader* reader, const std::string& prefix, SourceConfig* source) {
  source->ingest.self_filter = false;
  reader->read(prefix + "self_filter", &source->ingest.self_filter);
  if (source->ingest.self_filter) {
    reader->add_error("~" + prefix +
                      "self_filter is true: it is for clouds and scans; leave the robot out of the "
                      "map where the map is made");
  }
  if (!reader->has(prefix + "file")) return;
  reader->read(prefix + "file", &source->file);
  reader->read(prefix + "frame_id", &source->frame_id);
  if (source->file.empty() || source->file[0] != '/') {
    reader->add_error("~" + prefix + "file is \"" + source->file +
                      "\": an absolute path is needed, for example /home/robot/room.bt");
  }
  if (source->frame_id.empty()) {
    reader->add_error("~" + prefix + "frame_id is empty: the map's frame is needed");
  }
  if (reader->has(prefix + "topic")) {
    reader->add_error("~" + prefix + "topic and ~" + prefix + "file are both set: one is needed");
  }
}

void read_source(ParameterReader* reader, const std::string& prefix, SourceConfig* source) {
  read_type(reader, prefix, &source->type);
  if (source->type == SourceType::kMap) {
    read_map(reader, prefix, source);
  } else {
    read_ingest(reader, prefix, &source->ingest);
    if (source->type == SourceType::kCloud) read_noise(reader, prefix, &source->noise);
  }
  reader->read(prefix + "topic", &source->topic);
  if (source->topic.empty()) {
    reader->add_error("~" + prefix + "topic is empty: the name of a topic is needed");
  }
  if (source->file.empty()) {
    reader->read(prefix + "timeout", more_than_zero("s", kInf, true), &source->timeout);
  }
  reader->read(prefix + "required", &source->required);
}

std::vector<SourceConfig> read_sources(ParameterReader* reader) {
  // Parameters beside ~sources are for the single source, and defaults for several.
  SourceConfig single;
  reader->read("cloud_timeout", more_than_zero("s", kInf, true), &single.timeout);
  read_ingest(reader, "", &single.ingest);
  read_noise(reader, "", &single.noise);
  if (!reader->has("sources")) return {single};

  std::vector<SourceConfig> sources;
  for (const std::string& name : reader->children("sources")) {
    SourceConfig source = single;
    source.name = source.topic = name;
    const std::string prefix = "sources/" + name;
    source.timeout_parameter = prefix + "/timeout";
    reader->children(prefix);  // complains unless it is a dictionary
    read_source(reader, prefix + "/", &source);
    sources.push_back(source);
  }
  if (sources.empty() && reader->errors().empty()) {
    reader->add_error("~sources is empty: at least one source is needed, or no ~sources at all");
  }
  return sources;
}

bool read_repulsion(ParameterReader* reader, double max_distance, RepulsionConfig* repulsion) {
  reader->read("repulsion/influence_distance", more_than_zero("m", 1e3),
               &repulsion->influence_distance);
  reader->read("repulsion/gain", from_zero("", 1e6), &repulsion->gain);
  reader->read("repulsion/smoothing", more_than_zero("m", 10.0), &repulsion->smoothing);
  reader->read("repulsion/filter_time", from_zero("s", 10.0), &repulsion->filter_time);
  const bool clamped = repulsion->influence_distance > max_distance;
  if (clamped) repulsion->influence_distance = max_distance;
  return clamped && reader->has("repulsion/influence_distance");
}

void read_poses(ParameterReader* reader, ServerConfig* config) {
  reader->read("fixed_frame", &config->fixed_frame);
  std::string pose_source = "tf";
  reader->read_choice("pose_source", {"tf", "joint_states"}, &pose_source);
  config->pose_source = pose_source == "tf" ? PoseSourceKind::kTf : PoseSourceKind::kJointStates;
  reader->read("pose_timeout", more_than_zero("s", 3600.0), &config->pose_timeout);
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
  reader->read("packing/max_error", more_than_zero("m", 1.0), &config->model.packing.max_error);
  reader->read("packing/max_spheres", Range{"", 1.0, 1e6}, &config->model.packing.max_spheres);
  reader->read("packing/threads", from_zero("", 256), &config->model.threads);
  config->model.cache_directory = default_cache_directory();
  reader->read("cache_directory", &config->model.cache_directory);
  const std::string& cache = config->model.cache_directory;
  if (!cache.empty() && cache[0] != '/' && reader->has("cache_directory")) {
    reader->add_error("~cache_directory is \"" + cache +
                      "\": an absolute path is needed, or an empty one for no cache");
  }
}

void read_query(ParameterReader* reader, QueryConfig* query) {
  reader->read("query/tolerance", from_zero("m", 1.0), &query->tolerance);
  reader->read("query/deadline", from_zero("s", 10.0), &query->deadline);
  reader->read("query/margin", from_zero("m", 1.0), &query->margin);
}

void read_penetration(ParameterReader* reader, PenetrationConfig* penetration) {
  reader->read("penetration/stiffness", from_zero("N/m^3", 1e12), &penetration->stiffness);
}

void read_contacts(ParameterReader* reader, ServerConfig* config) {
  reader->read("penetration/enabled", &config->contacts_wanted);
  reader->read("penetration/max_error", more_than_zero("m", 1.0),
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
}

std::string joined(const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& line : lines) text += (text.empty() ? "" : "\n") + line;
  return text;
}

}  // namespace

XmlRpc::XmlRpcValue fetch_parameters(const ros::NodeHandle& private_nh) {
  XmlRpc::XmlRpcValue tree;
  ros::param::get(private_nh.getNamespace(), tree);
  return tree;
}

const char* message_type(SourceType type) {
  switch (type) {
    case SourceType::kScan:
      return "sensor_msgs/LaserScan";
    case SourceType::kMap:
      return "octomap_msgs/Octomap";
    case SourceType::kCloud:
      break;
  }
  return "sensor_msgs/PointCloud2";
}

const char* noun(SourceType type) {
  switch (type) {
    case SourceType::kScan:
      return "scan";
    case SourceType::kMap:
      return "map";
    case SourceType::kCloud:
      break;
  }
  return "cloud";
}

ServerConfig parse_parameters(const XmlRpc::XmlRpcValue& tree, std::vector<std::string>* warnings) {
  ParameterReader reader(tree);
  ServerConfig config;
  read_poses(&reader, &config);
  read_model(&reader, &config);
  reader.read("max_distance", more_than_zero("m", 1e3), &config.query.max_distance);
  read_query(&reader, &config.query);
  if (read_repulsion(&reader, config.query.max_distance, &config.repulsion)) {
    warnings->push_back(
        "~repulsion/influence_distance is more than ~max_distance, where measuring "
        "ends; ~max_distance is used");
  }
  read_contacts(&reader, &config);
  config.sources = read_sources(&reader);
  read_self_collision(&reader, &config.self_collision);

  if (!reader.errors().empty()) throw ParameterError(joined(reader.errors()));
  const std::vector<std::string> unknown = reader.unknown();
  warnings->insert(warnings->end(), unknown.begin(), unknown.end());
  // tf2 knows frames without the slash that older programs put in front.
  if (!config.fixed_frame.empty() && config.fixed_frame[0] == '/') config.fixed_frame.erase(0, 1);
  return config;
}

ServerConfig read_parameters(const ros::NodeHandle& private_nh) {
  std::vector<std::string> warnings;
  ServerConfig config = parse_parameters(fetch_parameters(private_nh), &warnings);
  for (const std::string& warning : warnings) ROS_WARN_STREAM(warning);
  return config;
}

LiveConfig parse_live(const XmlRpc::XmlRpcValue& tree, double max_distance,
                      std::vector<Tunable>* tunables) {
  ParameterReader reader(tree);
  LiveConfig live;
  live.query.max_distance = max_distance;
  read_query(&reader, &live.query);
  read_repulsion(&reader, max_distance, &live.repulsion);
  read_penetration(&reader, &live.penetration);
  if (tunables) *tunables = reader.tunables();
  if (!reader.errors().empty()) throw ParameterError(joined(reader.errors()));
  return live;
}

}  // namespace ist
