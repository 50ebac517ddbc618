#include "ros/parameters/source_parameters.h"

#include <limits>
#include <sstream>
#include <string>

#include "ros/parameters/extent_parameters.h"

namespace ist {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

void read_ingest(ParameterReader* reader, const std::string& prefix, IngestConfig* ingest) {
  const double default_max_range = ingest->max_range;
  reader->read(prefix + "min_range", Range::non_negative("m", 1e4), &ingest->min_range);
  reader->read(prefix + "max_range", Range::positive("m", kInf, true), &ingest->max_range);
  reader->read(prefix + "self_filter", &ingest->self_filter);
  reader->read(prefix + "self_filter_padding", Range::non_negative("m", 1.0),
               &ingest->self_filter_padding);
  if (!(ingest->max_range > ingest->min_range)) {
    std::ostringstream text;
    text << "~" << prefix << "max_range is " << ingest->max_range
         << " m: it must be more than min_range, which is " << ingest->min_range << " m";
    reader->add_error(text.str());
    ingest->max_range = default_max_range;
  }
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
      reader->read(prefix + "max_bytes", Range{"", 1.0, 2e9}, &source->map.max_bytes);
  }
}

void read_type(ParameterReader* reader, const std::string& prefix, SourceType* type) {
  const std::vector<SourceType> types = {SourceType::kCloud, SourceType::kDepthImage,
                                         SourceType::kScan, SourceType::kMap};
  std::vector<std::string> names;
  names.reserve(types.size());
  for (const SourceType one : types) names.emplace_back(message_type(one));
  std::string name = message_type(*type);
  reader->read_choice(prefix + "type", names, &name);
  for (const SourceType one : types) {
    if (name == message_type(one)) *type = one;
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
  if (source->type == SourceType::kMap) {
    read_map(reader, prefix, source);
    source->ingest.extent = ExtentConfig();  // defaults for all sources are those of sensors
    read_extent(reader, prefix, &source->ingest.extent);
    require_map_extent(reader, prefix, &source->ingest.extent);
  } else {
    read_ingest(reader, prefix, &source->ingest);
    read_extent(reader, prefix, &source->ingest.extent);
    require_extent(reader, prefix, source->ingest.max_range, &source->ingest.extent);
    if (source->type != SourceType::kScan) read_noise(reader, prefix, &source->noise);
  }
  read_limits(reader, prefix, source);
  reader->read(prefix + "topic", &source->topic);
  if (source->topic.empty()) {
    reader->add_error("~" + prefix + "topic is empty: the name of a topic is needed");
  }
  if (source->file.empty()) {
    reader->read(prefix + "timeout", Range::positive("s", kInf, true), &source->timeout);
  }
  if (source->type == SourceType::kDepthImage) {
    reader->read(prefix + "camera_info", &source->camera_info);
  }
  reader->read(prefix + "required", &source->required);
}

}  // namespace

std::vector<SourceConfig> read_sources(ParameterReader* reader) {
  // Parameters beside ~sources belong to the single source; with ~sources they are its defaults.
  SourceConfig single;
  reader->read("cloud_timeout", Range::positive("s", kInf, true), &single.timeout);
  read_ingest(reader, "", &single.ingest);
  read_extent(reader, "", &single.ingest.extent);
  if (!reader->has("sources")) {
    require_extent(reader, "", single.ingest.max_range, &single.ingest.extent);
  }
  read_noise(reader, "", &single.noise);
  read_limits(reader, "", &single);
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
  if (sources.empty() && reader->errors().empty()) {
    reader->add_error("~sources is empty: at least one source is needed, or no ~sources at all");
  }
  return sources;
}

}  // namespace ist
