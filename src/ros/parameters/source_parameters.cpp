#include "ros/parameters/source_parameters.h"

#include <limits>
#include <map>
#include <sstream>
#include <string>

#include "ros/parameters/extent_parameters.h"
#include "ros/parameters/world_parameters.h"

namespace ist {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

void read_view(ParameterReader* reader, const std::string& prefix, IngestConfig* ingest) {
  const bool is_view = ingest->self_filter_mode == SelfFilterMode::kView;
  std::string mode = is_view ? "view" : "padding";
  reader->read_choice(prefix + "self_filter_mode", {"padding", "view"}, &mode);
  ingest->self_filter_mode = mode == "view" ? SelfFilterMode::kView : SelfFilterMode::kPadding;
  ViewFilterConfig& view = ingest->view;
  const std::string of = prefix + "self_filter_view/";
  constexpr double kSmallest = 1e-6;  // errors of a sensor's pose are never less
  reader->read(of + "noise_constant", Range::non_negative("m", 1.0), &view.noise.constant);
  reader->read(of + "noise_quadratic", Range::non_negative("1/m", 1.0), &view.noise.quadratic);
  reader->read(of + "position_error", Range{"m", kSmallest, 1.0}, &view.position_error);
  reader->read(of + "angle_error", Range{"rad", kSmallest, 1.0}, &view.angle_error);
  reader->read(of + "model_error", Range::non_negative("m", 1.0), &view.model_error);
  reader->read(of + "time_error", Range::non_negative("s", 1.0), &view.time_error);
  reader->read(of + "mixed_pixels", Range::non_negative("pixels", 10.0), &view.mixed_pixels);
}

void read_ingest(ParameterReader* reader, const std::string& prefix, IngestConfig* ingest) {
  const double default_max_range = ingest->max_range;
  reader->read(prefix + "min_range", Range::non_negative("m", 1e4), &ingest->min_range);
  reader->read(prefix + "max_range", Range::positive("m", kInf, true), &ingest->max_range);
  reader->read(prefix + "sensor_range", Range::positive("m", kInf, true), &ingest->sensor_range);
  reader->read(prefix + "self_filter", &ingest->self_filter);
  reader->read(prefix + "self_filter_padding", Range::non_negative("m", 1.0),
               &ingest->self_filter_padding);
  read_view(reader, prefix, ingest);
  if (!(ingest->max_range > ingest->min_range)) {
    std::ostringstream text;
    text << "~" << prefix << "max_range is " << ingest->max_range
         << " m: it must be more than min_range, which is " << ingest->min_range << " m";
    reader->add_error(text.str());
    ingest->max_range = default_max_range;
  }
}

// When a sensor whose messages come all the same is blind, or stuck.
void read_failures(ParameterReader* reader, const std::string& prefix, SourceConfig* source) {
  reader->read(prefix + "min_measured", Range{"", 0.0, 1.0}, &source->min_measured);
  reader->read(prefix + "frozen_after", Range::positive("s", kInf, true), &source->frozen_after);
}

void read_noise(ParameterReader* reader, const std::string& prefix, NoiseFilterConfig* noise) {
  reader->read(prefix + "noise_filter/radius", Range::non_negative("m", 1.0), &noise->radius);
  reader->read(prefix + "noise_filter/neighbors", Range{"", 1.0, 1000.0}, &noise->neighbors);
}

// Upper limits of one message. The largest values are what 32 bits, or a machine's memory, hold.
void read_limits(ParameterReader* reader, const std::string& prefix, SourceConfig* source) {
  switch (source->type) {
    case SourceType::kCloud:
    case SourceType::kDepthImage:
      return reader->read(prefix + "max_points", Range{"", 1.0, 1e9}, &source->ingest.max_points);
    case SourceType::kScan:
      return reader->read(prefix + "max_beams", Range{"", 1.0, 1e7}, &source->scan.max_beams);
    case SourceType::kMap:
      reader->read(prefix + "max_leaves", Range{"", 1.0, 5e7}, &source->map.max_leaves);
      return reader->read(prefix + "max_bytes", Range{"", 1.0, 2e9}, &source->map.max_bytes);
    case SourceType::kWorld:
      break;  // see read_world()
  }
}

// The limits are those of MemoryConfig; 10^9 voxels take 8.6 GB.
void read_memory(ParameterReader* reader, const std::string& prefix, SourceMemoryConfig* memory) {
  reader->children(prefix + "memory");  // adds an error unless it is a dictionary
  reader->read(prefix + "memory/enabled", &memory->enabled);
  reader->read(prefix + "memory/decay", Range::positive("s", kInf, true), &memory->map.decay);
  reader->read(prefix + "memory/resolution", Range{"m", 0.001, 1.0}, &memory->map.resolution);
  reader->read(prefix + "memory/max_nodes", Range{"", 4096.0, 1e9}, &memory->map.max_nodes);
  reader->read(prefix + "memory/max_range", Range::positive("m", 100.0), &memory->map.max_range);
  reader->read(prefix + "memory/frame_id", &memory->frame_id);
  reader->read(prefix + "memory/file", &memory->file);
  if (!memory->file.empty() && memory->file[0] != '/') {
    reader->add_error("~" + prefix + "memory/file is \"" + memory->file +
                      "\": an absolute path is needed, for example /home/robot/memory.bt");
  }
}

// Each memory has a file of its own.
void check_memories(ParameterReader* reader, const std::vector<SourceConfig>& sources) {
  std::map<std::string, std::string> writers;
  for (const SourceConfig& source : sources) {
    const std::string& file = source.memory.file;
    if (!source.memory.enabled || file.empty()) continue;
    const auto [other, is_new] = writers.emplace(file, source.name);
    if (is_new) continue;
    reader->add_error("~sources/" + source.name + "/memory/file is \"" + file +
                      "\", and so is that of '" + other->second +
                      "': each memory needs a file of its own");
  }
}

void read_type(ParameterReader* reader, const std::string& prefix, SourceType* type) {
  const std::vector<SourceType> types = {SourceType::kCloud, SourceType::kDepthImage,
                                         SourceType::kScan, SourceType::kMap, SourceType::kWorld};
  const auto name_of = [](SourceType one) {
    return one == SourceType::kWorld ? kWorldType : message_type(one);
  };
  std::vector<std::string> names;
  names.reserve(types.size());
  for (const SourceType one : types) names.emplace_back(name_of(one));
  std::string name = name_of(*type);
  reader->read_choice(prefix + "type", names, &name);
  for (const SourceType one : types) {
    if (name == name_of(one)) *type = one;
  }
}

// A map has no sensor from which ranges count, and it holds no robot.
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
  if (source->type == SourceType::kCloud || source->type == SourceType::kDepthImage) {
    read_memory(reader, prefix, &source->memory);
  } else {
    source->memory.enabled = false;
    if (reader->has(prefix + "memory")) {
      reader->add_error("~" + prefix +
                        "memory is set: it is for clouds and depth images, not for a " +
                        message_type(source->type));
    }
  }
  if (source->type == SourceType::kMap) {
    read_map(reader, prefix, source);
    source->ingest.extent = ExtentConfig();  // defaults for all sources are those of sensors
    read_extent(reader, prefix, &source->ingest.extent);
    require_map_extent(reader, prefix, &source->ingest.extent);
  } else if (source->type == SourceType::kWorld) {
    read_world(reader, prefix, source);
  } else {
    if (!reader->has("sensor_range")) source->ingest.sensor_range = usual_range(source->type);
    read_ingest(reader, prefix, &source->ingest);
    read_failures(reader, prefix, source);
    read_extent(reader, prefix, &source->ingest.extent);
    require_extent(reader, prefix, source->ingest.max_range, &source->ingest.extent);
    if (source->type != SourceType::kScan) read_noise(reader, prefix, &source->noise);
  }
  read_limits(reader, prefix, source);
  reader->read(prefix + "topic", &source->topic);
  if (source->topic.empty()) {
    reader->add_error("~" + prefix + "topic is empty: the name of a topic is needed");
  }
  if (source->file.empty() && source->type != SourceType::kWorld) {
    reader->read(prefix + "timeout", Range::positive("s", kInf, true), &source->timeout);
  }
  if (source->type == SourceType::kDepthImage) {
    reader->read(prefix + "camera_info", &source->camera_info);
    reader->read(prefix + "depth_scale", Range{"m", 0.0, 1.0}, &source->depth_unit);
  }
  reader->read(prefix + "required", &source->required);
}

}  // namespace

std::vector<SourceConfig> read_sources(ParameterReader* reader) {
  // Parameters beside ~sources belong to the single source; with ~sources they are its defaults.
  SourceConfig single;
  reader->read("cloud_timeout", Range::positive("s", kInf, true), &single.timeout);
  single.ingest.sensor_range = usual_range(single.type);
  read_ingest(reader, "", &single.ingest);
  read_failures(reader, "", &single);
  read_extent(reader, "", &single.ingest.extent);
  if (!reader->has("sources")) {
    require_extent(reader, "", single.ingest.max_range, &single.ingest.extent);
  }
  read_noise(reader, "", &single.noise);
  read_limits(reader, "", &single);
  read_memory(reader, "", &single.memory);
  if (!reader->has("sources")) return {single};

  std::vector<SourceConfig> sources;
  for (const std::string& name : reader->children("sources")) {
    SourceConfig source = single;
    source.name = source.topic = name;
    const std::string prefix = "sources/" + name;
    source.timeout_parameter = prefix + "/timeout";
    reader->children(prefix);  // adds an error unless it is a dictionary
    read_source(reader, prefix + "/", &source);
    sources.push_back(source);
  }
  check_memories(reader, sources);
  if (sources.empty() && reader->errors().empty()) {
    reader->add_error("~sources is empty: at least one source is needed, or no ~sources at all");
  }
  return sources;
}

}  // namespace ist
