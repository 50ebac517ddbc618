#include "control/row_config.h"

#include <cmath>
#include <sstream>

namespace ist {
namespace {

// Calls check(holds, name, value, what is allowed) for every setting.
template <class Check>
void check_all(const RowConfig& c, const Check& check) {
  check(c.horizon > 0.0, "horizon", c.horizon, "more than 0 s");
  check(c.margin >= 0.0, "margin", c.margin, "0 m or more");
  check(c.stop_distance >= c.margin, "stop_distance", c.stop_distance, "margin or more");
  check(c.approach_time >= c.horizon, "approach_time", c.approach_time, "horizon or more");
  check(c.retreat_speed >= 0.0, "retreat_speed", c.retreat_speed, "0 m/s or more");
  check(c.escape_speed >= 0.0, "escape_speed", c.escape_speed, "0 m/s or more");
  check(c.obstacle_speed >= 0.0, "obstacle_speed", c.obstacle_speed, "0 m/s or more");
  check(c.age >= 0.0, "age", c.age, "0 s or more");
  check(c.blind_skin >= 0.0, "blind_skin", c.blind_skin, "0 m or more");
  check(c.linear_error > 0.0, "linear_error", c.linear_error, "more than 0 m");
}

}  // namespace

bool is_usable(const RowConfig& config) {
  bool all_hold = true;
  check_all(config, [&](bool holds, const char*, double value, const char*) {
    all_hold = all_hold && holds && std::isfinite(value);
  });
  return all_hold;
}

std::vector<std::string> config_errors(const RowConfig& config, const std::string& prefix) {
  std::vector<std::string> errors;
  check_all(config, [&](bool holds, const char* name, double value, const char* allowed) {
    if (holds && std::isfinite(value)) return;
    std::ostringstream text;
    text << prefix << name << " is " << value << "; it must be finite, and " << allowed << ".";
    errors.push_back(text.str());
  });
  return errors;
}

}  // namespace ist
