#include "ros/parameters/slider.h"

#include <algorithm>

namespace ist {
namespace {

// Ends of sliders are what robots and cameras need, so that a slider's pixels mean something. The
// ranges that a parameter accepts are much wider.
struct Entry {
  const char* name;
  double max;
  const char* meaning;
};

constexpr Entry kEntries[] = {
    {"query/tolerance", 0.05,
     "Largest difference between distance and lower_bound; 0: exact. Larger is faster."},
    {"query/deadline", 0.05,
     "Time after which a query ends with wider bounds; negative: a share of the period; 0: none."},
    {"query/margin", 0.2,
     "Taken off every lower_bound, for sensor noise, calibration and latency."},
    {"repulsion/influence_distance", 0.0,  // ~max_distance
     "From this distance on, repulsion is zero. At most ~max_distance."},
    {"repulsion/gain", 5.0, "Length of the repulsion vector at touch and in contact."},
    {"repulsion/smoothing", 0.5,
     "Obstacles this much farther than the nearest one still push. Larger is smoother."},
    {"repulsion/filter_time", 1.0, "Mean delay of the change that a new cloud brings; 0: none."},
    {"speed_scale/stop_distance", 0.0, "At this lower_bound and below, the speed scale is 0."},
    {"speed_scale/free_distance", 0.0, "From this lower_bound on, the speed scale is 1."},
    {"speed_scale/hysteresis", 0.1, "The scale rises only when the bound has risen by this much."},
    {"speed_scale/slow_distance", 0.0,
     "At this lower_bound the scale is slow_scale; 0: a straight line."},
    {"speed_scale/slow_scale", 1.0, "The scale at slow_distance."},
    {"speed_scale/self_stop_distance", 0.0, "At this distance from link to link the scale is 0."},
    {"speed_scale/self_free_distance", 0.0,
     "At this distance from link to link, and farther, it is 1."},
    {"speed_scale/separation/enabled", 1.0, "Whether the separation distance decides as well."},
    {"speed_scale/separation/obstacle_speed", 5.0,
     "Obstacles are taken to come at least this fast."},
    {"speed_scale/separation/robot_speed", 5.0, "Speed of the robot's fastest point at scale 1."},
    {"speed_scale/separation/reaction_time", 2.0, "Time from the scale to drives that brake."},
    {"speed_scale/separation/stopping_time", 2.0,
     "Time in which the robot stops from robot_speed."},
    {"speed_scale/separation/intrusion", 1.0, "How far a part may reach past the sensor unseen."},
    {"speed_scale/separation/uncertainty", 0.5, "Uncertainty of positions besides query/margin."},
    {"penetration/stiffness", 1e6, "Contact force per volume that link and obstacle share."},
};

}  // namespace

Slider slider_of(const Tunable& tunable, double max_distance) {
  Slider slider;
  slider.max = tunable.range.max;
  slider.tooltip = "~" + tunable.name;
  if (*tunable.range.unit) slider.tooltip += std::string(" [") + tunable.range.unit + "]";
  for (const Entry& entry : kEntries) {
    if (tunable.name != entry.name) continue;
    slider.max = std::min(tunable.range.max, entry.max > 0.0 ? entry.max : max_distance);
    slider.tooltip += std::string(": ") + entry.meaning;
  }
  // A value that is set must not be cut off by a slider.
  slider.max = std::max({slider.max, tunable.value, tunable.default_value});
  return slider;
}

}  // namespace ist
