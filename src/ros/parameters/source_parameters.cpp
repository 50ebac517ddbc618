#include "ros/parameters/source_parameters.h"

#include <algorithm>
#include <map>
#include <string>

#include "internal/geometry/numbers.h"
#include "ros/common/text.h"

namespace ist {
namespace {

using Footprint = ExtentConfig::Footprint;
const Range kTime = Range::positive("s", kInfinity, true);
const Range kMetre = Range::non_negative("m", 1.0);

/// The table of what a sensor's points have to pass: ranges, self-filter, signs of failure.
/// @param at  the prefix of the names
std::vector<Parameter> sensor_parameters(const std::string& at, SourceConfig* source) {
  IngestConfig& ingest = source->ingest;
  ViewFilterConfig& view = ingest.view;
  constexpr double kSmallest = 1e-6;  // errors of a sensor's pose are never less
  return {
      {at + "min_range", &ingest.min_range, Range::non_negative("m", 1e4)},
      {at + "max_range", &ingest.max_range, Range::positive("m", kInfinity, true)},
      {at + "sensor_range", &ingest.sensor_range, Range::positive("m", kInfinity, true)},
      {at + "min_measured", &source->min_measured, {"", 0.0, 1.0}},
      {at + "frozen_after", &source->frozen_after, kTime},
      {at + "self_filter", &ingest.self_filter},
      {at + "self_filter_mode", choice(&ingest.self_filter_mode, {"padding", "view"})},
      {at + "self_filter_view/position_error", &view.position_error, {"m", kSmallest, 1.0}},
      {at + "self_filter_view/angle_error", &view.angle_error, {"rad", kSmallest, 1.0}},
  };
}

std::vector<Parameter> noise_filter_parameters(const std::string& at, NoiseFilterConfig* noise) {
  return {{at + "noise_filter/radius", &noise->radius, kMetre},
          {at + "noise_filter/neighbors", &noise->neighbors, {"", 1.0, 1000.0}}};
}

/// Reads a number, or a dictionary of links in which `default` stands for all others.
void read_padding(ParameterReader* reader, const std::string& name, SourceConfig* source) {
  double* const largest = &source->ingest.self_filter_padding;
  if (reader->type(name) != XmlRpc::XmlRpcValue::TypeStruct) {
    if (reader->has(name)) source->link_paddings.clear();
    return reader->read({name, largest, kMetre});
  }
  if (source->link_paddings.empty()) source->other_padding = *largest;
  source->link_paddings.clear();
  for (const std::string& link : reader->children(name)) {
    reader->read({name + "/" + link,
                  link == "default" ? &source->other_padding : &source->link_paddings[link],
                  kMetre});
  }
  *largest = source->other_padding;
  for (const auto& [link, padding] : source->link_paddings) *largest = std::max(*largest, padding);
}

/// The table of a memory. The limits are those of MemoryConfig; 10^9 voxels take 8.6 GB.
std::vector<Parameter> memory_parameters(const std::string& at, SourceMemoryConfig* memory) {
  return {{at + "memory/enabled", &memory->enabled},
          {at + "memory/decay", &memory->map.decay, kTime},
          {at + "memory/resolution", &memory->map.resolution, {"m", 0.001, 1.0}},
          {at + "memory/max_nodes", &memory->map.max_nodes, {"", 4096.0, 1e9}},
          {at + "memory/max_range", &memory->map.max_range, Range::positive("m", 100.0)},
          {at + "memory/frame_id", &memory->frame_id}};
}

/// The upper limits of one message: the largest are what 32 bits, or a machine's memory, hold.
std::vector<Parameter> limit_parameters(const std::string& at, SourceConfig* source) {
  switch (source->type) {
    case SourceType::kCloud:
    case SourceType::kDepthImage:
      return {{at + "max_points", &source->ingest.max_points, {"", 1.0, 1e9}}};
    case SourceType::kMap:
      return {{at + "max_leaves", &source->map.max_leaves, {"", 1.0, 5e7}},
              {at + "max_bytes", &source->map.max_bytes, {"", 1.0, 2e9}}};
    case SourceType::kScan:   // no scanner has more than a third of ScanLimits::max_beams
    case SourceType::kWorld:  // see read_world()
      break;
  }
  return {};
}

void read_sensor(ParameterReader* reader, const std::string& at, SourceConfig* source) {
  IngestConfig& ingest = source->ingest;
  const double default_max_range = ingest.max_range;
  reader->read_all(sensor_parameters(at, source));
  read_padding(reader, at + "self_filter_padding", source);
  if (ingest.self_filter_mode == SelfFilterMode::kView) source->link_paddings.clear();
  if (ingest.max_range > ingest.min_range) return;
  reader->add_error(at + "max_range", format_text("is %g m: it must be more than min_range, which "
                                                  "is %g m",
                                                  ingest.max_range, ingest.min_range));
  ingest.max_range = default_max_range;
}

void read_memory(ParameterReader* reader, const std::string& at, SourceMemoryConfig* memory) {
  reader->read_all(memory_parameters(at, memory));
  read_path(reader, at + "memory/file", "/home/robot/memory.bt", &memory->file, true);
}

/// Reads the name of a published model of noise.
void read_sensor_model(ParameterReader* reader, const std::string& name, ExtentConfig* config) {
  std::vector<std::string> names = {"none"};
  for (const SensorModel& model : sensor_models()) names.emplace_back(model.name);
  std::size_t chosen = 0;
  reader->read({name, choice(&chosen, names)});
  const SensorModel* model = find_sensor_model(names[chosen]);
  if (model == nullptr) return;
  config->noise_constant = model->noise_constant;
  config->noise_quadratic = model->noise_quadratic;
  config->calibration = model->calibration;
  config->calibration_angle = model->calibration_angle;
  config->field_of_view = model->field_of_view;
}

void read_footprint(ParameterReader* reader, const std::string& name, ExtentConfig* config) {
  const Range angle = Range::non_negative("rad", 0.5);
  const XmlRpc::XmlRpcValue::Type type = reader->type(name);
  if (type == XmlRpc::XmlRpcValue::TypeInvalid) return;
  if (type == XmlRpc::XmlRpcValue::TypeString) {
    bool of_camera = false;
    reader->read({name, choice(&of_camera, {"none", "camera"})});
    config->footprint = of_camera ? Footprint::kCamera : Footprint::kNone;
    return;
  }
  if (type != XmlRpc::XmlRpcValue::TypeStruct) {
    reader->read({name, &config->footprint_angle, angle});
    config->footprint = Footprint::kAngle;
    return;
  }
  double field_of_view = 0.0;
  reader->read_all({{name + "/radius", &config->footprint_radius, kMetre},
                    {name + "/angle", &config->footprint_angle, angle},
                    {name + "/field_of_view", &field_of_view, Range::non_negative("rad", 3.0)}});
  if (field_of_view > 0.0) config->field_of_view = field_of_view;
  const bool has_radius = reader->has(name + "/radius"), has_angle = reader->has(name + "/angle");
  config->footprint = has_radius  ? Footprint::kRadius
                      : has_angle ? Footprint::kAngle
                                  : Footprint::kCamera;
  if (has_radius && has_angle) {
    reader->add_error(name + "/radius", "and ~" + name + "/angle are both set: one is needed");
  }
}

/// Reads what makes points larger than points: `noise`, `footprint` and `latency`. Each may be a
/// single value, or a dictionary.
void read_extent(ParameterReader* reader, const std::string& at, ExtentConfig* config) {
  const auto is_dictionary = [&](const char* name) {
    return reader->type(at + name) == XmlRpc::XmlRpcValue::TypeStruct;
  };
  const bool has_terms = is_dictionary("noise");
  read_sensor_model(reader, at + (has_terms ? "noise/sensor" : "noise"), config);
  if (has_terms) {
    reader->read_all({{at + "noise/a", &config->noise_constant, kMetre},
                      {at + "noise/b", &config->noise_quadratic, Range::non_negative("1/m", 1.0)},
                      {at + "noise/k", &config->sigmas, Range::non_negative("", 10.0)},
                      {at + "noise/calibration", &config->calibration, kMetre},
                      {at + "noise/calibration_angle", &config->calibration_angle,
                       Range::non_negative("rad", 0.5)}});
  }
  read_footprint(reader, at + "footprint", config);
  const bool has_speed = is_dictionary("latency");
  reader->read({at + (has_speed ? "latency/time" : "latency"), &config->latency,
                Range::non_negative("s", 10.0)});
  if (has_speed) {
    reader->read({at + "latency/speed", &config->speed, Range::non_negative("m/s", 20.0)});
  }
}

/// The self-filter by view rests on the sensor's noise where it is stated.
void take_noise(IngestConfig* ingest) {
  const ExtentConfig& stated = ingest->extent;
  if (stated.noise_constant <= 0.0 && stated.noise_quadratic <= 0.0) return;
  ingest->view.noise.constant = stated.noise_constant;
  ingest->view.noise.quadratic = stated.noise_quadratic;
}

/// Adds an error where the points' radius at max_range [m] has no sensible size; `config` asks for
/// nothing then.
void require_extent(ParameterReader* reader, const std::string& at, double max_range,
                    ExtentConfig* config) {
  if (config->is_zero()) return;
  const std::string fault = check_extent(*config, max_range);
  if (fault.empty()) return;
  reader->add_error("~" + at + "noise, footprint and latency: " + fault);
  *config = ExtentConfig();
}

/// The same for a map, whose boxes have one radius.
void require_map_extent(ParameterReader* reader, const std::string& at, ExtentConfig* config) {
  if (config->is_zero()) return;
  const PointExtent extent = point_extent(*config, 0.0, kInfinity);
  if (extent.linear > 0.0 || extent.quadratic > 0.0 || config->footprint == Footprint::kCamera) {
    reader->add_error(at + "noise",
                      "and footprint grow with the range, but a map has no sensor from which "
                      "ranges count: noise/a, noise/k, noise/calibration, footprint/radius and "
                      "latency are for maps");
    *config = ExtentConfig();
    return;
  }
  require_extent(reader, at, kInfinity, config);
}

// Each memory has a file of its own.
void check_memories(ParameterReader* reader, const std::vector<SourceConfig>& sources) {
  std::map<std::string, std::string> writers;
  for (const SourceConfig& source : sources) {
    const std::string& file = source.memory.file;
    if (!source.memory.enabled || file.empty()) continue;
    const auto [other, is_new] = writers.emplace(file, source.name);
    if (is_new) continue;
    reader->add_error("sources/" + source.name + "/memory/file",
                      "is \"" + file + "\", and so is that of '" + other->second +
                          "': each memory needs a file of its own");
  }
}

// A map has no sensor from which ranges count, and it holds no robot.
void read_map(ParameterReader* reader, const std::string& at, SourceConfig* source) {
  source->ingest.self_filter = false;
  reader->read({at + "self_filter", &source->ingest.self_filter});
  if (source->ingest.self_filter) {
    reader->add_error(at + "self_filter",
                      "is true: it is for clouds and scans; leave the robot out of the map where "
                      "the map is made");
  }
  source->ingest.extent = ExtentConfig();  // defaults for all sources are those of sensors
  read_extent(reader, at, &source->ingest.extent);
  require_map_extent(reader, at, &source->ingest.extent);
  if (!reader->has(at + "file")) return;
  read_path(reader, at + "file", "/home/robot/room.bt", &source->file);
  reader->read({at + "frame_id", &source->frame_id});
  if (source->frame_id.empty()) {
    reader->add_error(at + "frame_id", "is empty: the map's frame is needed");
  }
  if (reader->has(at + "topic")) {
    reader->add_error(at + "topic", "and ~" + at + "file are both set: one is needed");
  }
}

// The depth cameras that arms carry measure up to 10 m, and other sensors 100 m; lengths in
// millimetres are longer from 10 and 100 mm on.
double usual_range(SourceType type) { return type == SourceType::kDepthImage ? 10.0 : 100.0; }

void read_source(ParameterReader* reader, const std::string& at, SourceConfig* source) {
  std::vector<std::string> types(static_cast<std::size_t>(SourceType::kWorld) + 1, "world");
  for (std::size_t i = 0; i + 1 < types.size(); ++i) {
    types[i] = message_type(static_cast<SourceType>(i));
  }
  reader->read({at + "type", choice(&source->type, types)});
  const bool is_image = source->type == SourceType::kDepthImage;
  const bool is_cloud = source->type == SourceType::kCloud || is_image;
  if (is_cloud) {
    read_memory(reader, at, &source->memory);
    reader->read_all(noise_filter_parameters(at, &source->noise));
  } else {
    source->memory.enabled = false;
    if (reader->has(at + "memory")) {
      reader->add_error(at + "memory",
                        std::string("is set: it is for clouds and depth images, not for a ") +
                            message_type(source->type));
    }
  }
  if (source->type == SourceType::kMap) {
    read_map(reader, at, source);
  } else if (source->type == SourceType::kWorld) {
    read_world(reader, at, source);
  } else {
    if (!reader->has("sensor_range")) source->ingest.sensor_range = usual_range(source->type);
    read_sensor(reader, at, source);
    read_extent(reader, at, &source->ingest.extent);
    take_noise(&source->ingest);
    require_extent(reader, at, source->ingest.max_range, &source->ingest.extent);
  }
  reader->read_all(limit_parameters(at, source));
  reader->read_all({{at + "topic", &source->topic}, {at + "required", &source->required}});
  if (source->topic.empty()) {
    reader->add_error(at + "topic", "is empty: the name of a topic is needed");
  }
  if (source->file.empty() && source->type != SourceType::kWorld) {
    reader->read({at + "timeout", &source->timeout, kTime});
  }
  if (is_image) {
    reader->read_all({{at + "camera_info", &source->camera_info},
                      {at + "depth_scale", &source->depth_unit, {"m", 0.0, 1.0}}});
  }
}

}  // namespace

void read_path(ParameterReader* reader, const std::string& name, const char* example,
               std::string* path, bool may_be_empty) {
  reader->read({name, path});
  if (path->empty() ? may_be_empty : (*path)[0] == '/') return;
  reader->add_error(name,
                    "is \"" + *path + "\": an absolute path is needed, for example " + example);
}

std::vector<SourceConfig> read_sources(ParameterReader* reader) {
  // Parameters beside ~sources belong to the single source; with ~sources they are its defaults.
  SourceConfig single;
  single.ingest.sensor_range = usual_range(single.type);
  reader->read({"cloud_timeout", &single.timeout, kTime});
  read_sensor(reader, "", &single);
  read_extent(reader, "", &single.ingest.extent);
  take_noise(&single.ingest);
  reader->read_all(noise_filter_parameters("", &single.noise));
  reader->read_all(limit_parameters("", &single));
  read_memory(reader, "", &single.memory);
  if (!reader->has("sources")) {
    require_extent(reader, "", single.ingest.max_range, &single.ingest.extent);
    return {single};
  }
  std::vector<SourceConfig> sources;
  for (const std::string& name : reader->children("sources")) {
    SourceConfig source = single;
    source.name = source.topic = name;
    const std::string prefix = "sources/" + name;
    source.timeout_parameter = prefix + "/timeout";
    read_source(reader, prefix + "/", &source);
    sources.push_back(source);
  }
  check_memories(reader, sources);
  if (sources.empty() && reader->errors().empty()) {
    reader->add_error("sources", "is empty: at least one source is needed, or no ~sources at all");
  }
  return sources;
}

}  // namespace ist
