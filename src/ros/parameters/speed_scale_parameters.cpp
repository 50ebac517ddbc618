#include "ros/parameters/speed_scale_parameters.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

namespace ist {
namespace {

constexpr char kPrefix[] = "~speed_scale/";
constexpr double kMaxLength = 1e3;  // [m] as ~max_distance

Range length() { return Range::non_negative("m", kMaxLength); }

/// The two distances that a link may have of its own.
struct OwnDistance {
  const char* name;
  double LinkSpeedDistances::*value;
};
constexpr OwnDistance kOwnDistances[] = {{"stop_distance", &LinkSpeedDistances::stop_distance},
                                         {"free_distance", &LinkSpeedDistances::free_distance}};

std::string path_of(const std::string& link, const char* name) {
  return "speed_scale/links/" + link + "/" + name;
}

/// Reads the numbers, without those of single links.
void read_numbers(ParameterReader* reader, SpeedScaleConfig* config) {
  reader->read("speed_scale/stop_distance", length(), &config->stop_distance);
  reader->read("speed_scale/free_distance", length(), &config->free_distance);
  reader->read("speed_scale/hysteresis", length(), &config->hysteresis);
  reader->read("speed_scale/slow_distance", length(), &config->slow_distance);
  reader->read("speed_scale/slow_scale", Range{"", 0.0, 1.0}, &config->slow_scale);
  reader->read("speed_scale/self_stop_distance", length(), &config->self_stop_distance);
  reader->read("speed_scale/self_free_distance", length(), &config->self_free_distance);
  SeparationConfig& separation = config->separation;
  reader->read("speed_scale/separation/enabled", &separation.enabled);
  reader->read("speed_scale/separation/obstacle_speed", Range::non_negative("m/s", 100.0),
               &separation.obstacle_speed);
  reader->read("speed_scale/separation/robot_speed", Range{"m/s", 1e-3, 100.0},
               &separation.robot_speed);
  reader->read("speed_scale/separation/reaction_time", Range::non_negative("s", 100.0),
               &separation.reaction_time);
  reader->read("speed_scale/separation/stopping_time", Range::non_negative("s", 100.0),
               &separation.stopping_time);
  reader->read("speed_scale/separation/intrusion", length(), &separation.intrusion);
  reader->read("speed_scale/separation/uncertainty", length(), &separation.uncertainty);
}

/// Reads the distances that links have of their own already.
void read_own_distances(ParameterReader* reader, SpeedScaleConfig* config) {
  for (LinkSpeedDistances& link : config->links) {
    for (const OwnDistance& own : kOwnDistances) {
      if (std::isnan(link.*own.value)) continue;
      reader->read(path_of(link.link, own.name), length(), &(link.*own.value));
    }
  }
}

bool has_own(const SpeedScaleConfig& config, const std::string& link, const OwnDistance& own) {
  for (const LinkSpeedDistances& one : config.links) {
    if (one.link == link) return !std::isnan(one.*own.value);
  }
  return false;
}

void find_new_distances(ParameterReader* reader, const SpeedScaleConfig& config) {
  for (const std::string& link : reader->children("speed_scale/links")) {
    for (const OwnDistance& own : kOwnDistances) {
      const std::string path = path_of(link, own.name);
      if (reader->has(path) && !has_own(config, link, own)) {
        reader->add_error("~" + path + " was not set at the start: restart the node to use it");
      }
    }
  }
}

}  // namespace

SpeedScaleConfig read_speed_scale(ParameterReader* reader, double max_distance) {
  const bool has_distances =
      reader->has("speed_scale/stop_distance") || reader->has("speed_scale/free_distance");
  SpeedScaleConfig config = fitted_to({}, max_distance);
  if (has_distances) {
    config.stop_distance = SpeedScaleConfig().stop_distance;
    config.free_distance = SpeedScaleConfig().free_distance;
  }
  // The one that is not set stays in its place relative to the other.
  if (has_distances && !reader->has("speed_scale/free_distance")) {
    config.free_distance = std::min(config.free_distance, max_distance);
  }
  const std::size_t errors_before = reader->errors().size();
  read_numbers(reader, &config);
  reader->children("speed_scale/separation");  // adds an error unless it is a dictionary
  for (const std::string& name : reader->children("speed_scale/links")) {
    LinkSpeedDistances link;
    link.link = name;
    reader->children("speed_scale/links/" + name);
    for (const OwnDistance& own : kOwnDistances) {
      // Any number; the one that is set takes its place.
      if (reader->has(path_of(name, own.name))) link.*own.value = config.stop_distance;
    }
    config.links.push_back(link);
  }
  read_own_distances(reader, &config);
  if (reader->errors().size() > errors_before) return config;  // each is told already
  for (const std::string& error : config_errors(config, kPrefix, max_distance)) {
    reader->add_error(error);
  }
  return config;
}

void read_live_speed_scale(const XmlRpc::XmlRpcValue& tree, double max_distance,
                           LiveReading* reading) {
  const SpeedScaleConfig last = reading->config.speed_scale;
  ParameterReader reader(tree);
  reader.children("speed_scale");
  read_numbers(&reader, &reading->config.speed_scale);
  read_own_distances(&reader, &reading->config.speed_scale);
  find_new_distances(&reader, last);
  std::vector<Tunable> tunables = reader.tunables();
  const std::vector<std::string> conflicts =
      config_errors(reading->config.speed_scale, kPrefix, max_distance);
  if (!conflicts.empty()) {
    reading->config.speed_scale = last;
    ParameterReader kept{XmlRpc::XmlRpcValue()};
    read_numbers(&kept, &reading->config.speed_scale);
    read_own_distances(&kept, &reading->config.speed_scale);
    tunables = kept.tunables();
  }
  reading->tunables.insert(reading->tunables.end(), tunables.begin(), tunables.end());
  reading->errors.insert(reading->errors.end(), reader.errors().begin(), reader.errors().end());
  reading->errors.insert(reading->errors.end(), conflicts.begin(), conflicts.end());
}

}  // namespace ist
