#include "ros/parameters/parameter_table.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <map>
#include <set>
#include <string>

#include "internal/geometry/numbers.h"
#include "ros/common/text.h"

namespace ist {
namespace {

// By type.
constexpr const char* kMessages[] = {"sensor_msgs/PointCloud2", "sensor_msgs/Image",
                                     "sensor_msgs/LaserScan", "octomap_msgs/Octomap",
                                     "ist_proximity/WorldObjects"};
constexpr const char* kNouns[] = {"cloud", "image", "scan", "map", "world"};
constexpr std::size_t kTypes = static_cast<std::size_t>(SourceType::kWorld) + 1;
static_assert(std::size(kMessages) == kTypes && std::size(kNouns) == kTypes);

/// The paddings by link, and the largest, which is that of Ingest.
void read_paddings(ParameterReader* reader, const std::string& at, SourceConfig* source) {
  const std::string name = at + "self_filter_padding";
  if (reader->has(name)) source->link_paddings.clear();
  reader->read_by_name(name, Range::non_negative("m", 1.0), &source->link_paddings);
  double* const largest = &source->ingest.self_filter_padding;
  *largest = source->other_padding;
  for (const auto& [link, padding] : source->link_paddings) *largest = std::max(*largest, padding);
  if (source->ingest.self_filter_mode == SelfFilterMode::kView) source->link_paddings.clear();
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

void read_sensor(ParameterReader* reader, const std::string& at, SourceConfig* source) {
  IngestConfig& ingest = source->ingest;
  // The depth cameras that arms carry measure up to 10 m, and other sensors 100 m; lengths in
  // millimetres are longer from 10 and 100 mm on. Who has a larger max_range believes more.
  ingest.sensor_range = source->type == SourceType::kDepthImage ? 10.0 : 100.0;
  read_paddings(reader, at, source);
  const ExtentConfig& extent = ingest.extent;
  if (extent.noise_constant > 0.0 || extent.noise_quadratic > 0.0) {
    ingest.view.noise.constant = extent.noise_constant;
    ingest.view.noise.quadratic = extent.noise_quadratic;
  }
  if (!(ingest.max_range > ingest.min_range)) {
    reader->add_error(at + "max_range",
                      format_text("is %g m: it must be more than min_range, which is %g m",
                                  ingest.max_range, ingest.min_range));
    ingest.max_range = ingest.min_range + IngestConfig().max_range;
  }
}

/// Names parameters that are for sources of other types only: a map has no memory, for example.
void refuse_others(ParameterReader* reader, const std::string& at, SourceConfig* source) {
  std::set<std::string> own;
  for (const Parameter& row : source_parameters(at, source)) own.insert(row.name);
  for (int i = 0; i <= static_cast<int>(SourceType::kWorld); ++i) {
    SourceConfig other;
    other.type = static_cast<SourceType>(i);
    for (const Parameter& row : source_parameters(at, &other)) {
      if (!reader->has(row.name) || !own.insert(row.name).second) continue;
      reader->read(row);
      if (row.is_bool() && row.number() == 0.0) continue;  // self_filter: false
      reader->add_error(row.name, std::string("is set: it is not for a source of type ") +
                                      message_type(source->type));
    }
  }
}

void check_map(ParameterReader* reader, const std::string& at, const SourceConfig& source) {
  if (!reader->has(at + "file")) return;
  if (source.frame_id.empty()) {
    reader->add_error(at + "frame_id", "is empty: the map's frame is needed");
  }
  if (reader->has(at + "topic")) {
    reader->add_error(at + "topic", "and ~" + at + "file are both set: one is needed");
  }
}

/// @param source  holds the defaults of all sources, which are those of sensors
void read_source(ParameterReader* reader, const std::string& at, SourceConfig* source) {
  reader->read(source_parameters(at, source).front());  // the type, on which the others depend
  const SourceType type = source->type;
  const bool is_map = type == SourceType::kMap, is_world = type == SourceType::kWorld;
  if (is_map || is_world || type == SourceType::kScan) source->memory.enabled = false;
  if (is_map || is_world) {
    source->ingest.self_filter = false;
    source->ingest.extent = ExtentConfig();
  }
  if (is_world) source->timeout = kInfinity;  // objects are sent when they change
  reader->read_all(source_parameters(at, source));
  refuse_others(reader, at, source);
  if (source->topic.empty()) {
    reader->add_error(at + "topic", "is empty: the name of a topic is needed");
  }
  if (is_world) return read_world(reader, at, source);
  if (is_map) {
    check_map(reader, at, *source);
  } else {
    read_sensor(reader, at, source);
  }
  ExtentConfig* const extent = &source->ingest.extent;
  require_extent(reader, at, is_map ? kInfinity : source->ingest.max_range, extent);
}

/// Each memory has a file of its own.
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

}  // namespace

const char* message_type(SourceType type) { return kMessages[static_cast<int>(type)]; }

const char* noun(SourceType type) { return kNouns[static_cast<int>(type)]; }

bool SourceConfig::is_permanent() const {
  const bool stays = type == SourceType::kMap || type == SourceType::kWorld;
  return stays && (!file.empty() || std::isinf(timeout));
}

bool SourceConfig::has_zones() const {
  const bool measures = type != SourceType::kMap && type != SourceType::kWorld;
  return measures && !std::isinf(timeout) && ingest.self_filter_mode != SelfFilterMode::kView;
}

std::vector<SourceConfig> read_sources(ParameterReader* reader) {
  // Parameters beside ~sources belong to the single source; with ~sources they are its defaults.
  SourceConfig single;
  reader->read_all(source_parameters("", &single));
  read_sensor(reader, "", &single);
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
