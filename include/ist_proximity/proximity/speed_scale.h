#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "ist_proximity/geometry/span.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/proximity/stopping_reach.h"

namespace ist {

/// Distances of one link that differ from the robot's.
struct LinkSpeedDistances {
  /// Stands for the robot's distance.
  static constexpr double kAsRobot = std::numeric_limits<double>::quiet_NaN();

  std::string link;                 ///< name in the URDF
  double stop_distance = kAsRobot;  ///< [m]; NaN: the robot's
  double free_distance = kAsRobot;  ///< [m]; NaN: the robot's
};

/// The protective separation distance of ISO 10218-2:2025 (before: ISO/TS 15066:2016, 5.5.4),
/// solved for the robot's speed. This library is not safety-rated; the formula is used, no
/// conformity is claimed.
struct SeparationConfig {
  bool enabled = false;  ///< false: the distances alone decide
  /// [m/s] >= 0 K of ISO 13855:2024: obstacles are taken to approach at least this fast. 1.6 is a
  /// walking person; ISO 13855 asks for 2.0 where hands are nearer than 0.5 m.
  double obstacle_speed = 1.6;
  /// [m/s] > 0: the fastest point of the robot at scale 1, where SpeedScaleInput::reach is not
  /// known.
  double robot_speed = 1.0;
  double reaction_time = 0.1;  ///< [s] >= 0, of controller and drives, besides the data's age
  double stopping_time = 0.3;  ///< [s] >= 0, in which the robot stops from robot_speed; likewise
  double intrusion = 0.0;      ///< [m] >= 0, C: reach of a part past the sensor before it is seen
  double uncertainty = 0.0;    ///< [m] >= 0, Z_d + Z_r, what ~query/margin does not hold yet
};

/// How fast the robot may go, by distance; see SpeedScale.
struct SpeedScaleConfig {
  double stop_distance = 0.10;  ///< [m] >= 0: from here on inward the scale is 0
  double free_distance = 0.30;  ///< [m] > stop_distance: from here on outward it is 1
  /// [m] >= 0: the bound has to rise by this much before the scale rises with it. Six standard
  /// deviations of the bound's noise leave no chatter.
  double hysteresis = 0.03;
  /// [m] between stop_distance and free_distance, where the scale is `slow_scale`; 0: none, and the
  /// scale rises along one straight line.
  double slow_distance = 0.0;
  double slow_scale = 0.3;                ///< 0 to 1
  std::vector<LinkSpeedDistances> links;  ///< those with distances of their own
  /// [m] stop_distance from link to link, where that counts; see between_links().
  double self_stop_distance = 0.01;
  double self_free_distance = 0.05;  ///< [m] free_distance from link to link
  SeparationConfig separation;       ///< a second rule; the smaller scale holds
};

/// The configuration for distances from link to link: its own stop and free distance for every
/// link, no separation distance, and no hysteresis, because no sensor's noise is in them.
SpeedScaleConfig between_links(const SpeedScaleConfig& config);

/// Lists what is wrong with a configuration: one sentence each, with the parameter's name, its
/// value and what is allowed. Empty: it can be used.
/// @param prefix        before each name, such as "~speed_scale/"
/// @param max_distance  [m] of the queries: no link is known to be farther away than this
std::vector<std::string> config_errors(const SpeedScaleConfig& config, const std::string& prefix,
                                       double max_distance);

/// Makes stop_distance and free_distance fit a smaller range of the queries, in proportion.
SpeedScaleConfig fitted_to(SpeedScaleConfig config, double max_distance);

/// The rules that decide a speed scale.
enum class SpeedRule : std::uint8_t {
  kUnknown = 0,     ///< 0: something required is not known
  kStop = 1,        ///< 0: a link is within its stop distance
  kSlow = 2,        ///< between 0 and 1: a link is within its free distance
  kFree = 3,        ///< 1: every link is farther away than its free distance
  kSeparation = 4,  ///< less than the distances allow: the separation distance asks for it
};

/// One link's part of a speed scale.
struct SpeedScaleInput {
  LinkState state = LinkState::kUnknown;                          ///< as the query says
  double lower_bound = -std::numeric_limits<double>::infinity();  ///< [m] proven
  /// [m/s] ClosingRates::obstacles; NaN: not known
  double obstacle_speed = std::numeric_limits<double>::quiet_NaN();
  /// The link's way until it stands, from the speed at scale 1; none: see SeparationConfig.
  std::optional<StoppingReach> reach = std::nullopt;
};

/// A speed scale, and why.
struct SpeedScaleAnswer {
  double scale = 0.0;                    ///< 0 to 1; never NaN
  SpeedRule rule = SpeedRule::kUnknown;  ///< what decided
  std::int32_t link = -1;                ///< the link that decides; -1: none does
  /// [m] the bound that was used: the link's own, or a smaller one that hysteresis holds. NaN
  /// where no link decides.
  double bound = std::numeric_limits<double>::quiet_NaN();
  double stop_distance = 0.0;  ///< [m] of the link that decides, else of the robot
  double free_distance = 0.0;  ///< [m] likewise
};

/// The share of its speed at which a robot may go: 0 within a link's stop distance, 1 outside its
/// free distance, and rising in between, for the link that allows the least. It rests on
/// `lower_bound`, which is proven, whatever the state: never on `distance`, and a link that is
/// CLEAR may have a small bound where space has not been seen. Anything that is not known makes it
/// 0.
///
/// Hysteresis: a link's bound is followed downward at once, and upward at a distance of
/// `hysteresis`, so the bound used is never above the link's own. Noise that is smaller than the
/// hysteresis changes nothing. Time does not matter.
///
/// The scale, with SeparationConfig::enabled, is also limited to what ISO 10218-2 allows. With
/// T_r = reaction_time + age and T_s = stopping_time, the separation distance is
///   S = v_h (T_r + T_s) + v_r T_r + v_r T_s / 2 + C + Z,
/// where v_h is obstacle_speed, or the obstacles' measured speed where that is larger, and the
/// robot stops from v_r at constant deceleration. v_r is solved for S = bound, and the scale is
/// v_r / robot_speed. Where a link's reach (speed v, distance b, time t at scale 1) is known, it
/// takes the place of both constants: at the scale k the link goes k v T_r + k^2 b until it stands,
/// in T_s = k t, and k is solved for
///   bound = v_h (T_r + k t) + k v T_r + k^2 b + C + Z.
/// The robot's measured speed is not used: it depends on the scale itself.
///
/// One object per robot, one thread. update() allocates nothing.
class SpeedScale {
 public:
  /// @param links  names, in the order of the inputs
  explicit SpeedScale(std::vector<std::string> links);

  /// @param config  without config_errors(); one that names a link that is not there makes the
  ///                scale 0, because the link that is meant has not its distances
  /// @param links   by link
  /// @param counts  by link: false leaves it out, whatever its state
  /// @param age     [s] of the oldest measurement in use, poses included; NaN: not known. Read by
  ///                the separation distance alone
  SpeedScaleAnswer update(const SpeedScaleConfig& config, Span<const SpeedScaleInput> links,
                          const std::vector<bool>& counts, double age);

  /// Forgets what hysteresis holds.
  void reset();

  /// Names in config.links that are no link's.
  std::vector<std::string> unknown_links(const SpeedScaleConfig& config) const;

 private:
  struct Distances {
    double stop, free;
  };
  Distances distances(const SpeedScaleConfig& config, std::size_t link) const;
  bool knows_all_links(const SpeedScaleConfig& config) const;
  void hold_bound(std::size_t link, const SpeedScaleInput& input, double free, double hysteresis);

  std::vector<std::string> links_;
  std::vector<double> held_;  ///< [m] by link: the bound that was used last; NaN: none
};

}  // namespace ist
