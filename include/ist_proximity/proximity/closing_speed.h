#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "ist_proximity/proximity/proximity_query.h"

namespace ist {

/// The speeds [m/s] at which a link and the nearest obstacle get closer, positive when they do; NaN
/// where a speed cannot be known.
struct ClosingRates {
  /// Not known.
  static constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

  double total = kNaN;      ///< robot + obstacles; NaN where either is
  double robot = kNaN;      ///< part by the motion of the link's closest point
  double obstacles = kNaN;  ///< part by the motion of obstacles; 0 where noise may explain it
  /// [s] from the time of the poses until the lower bound is 0 at these rates; +inf when not
  /// closing by kNoiseFloor or more, 0 in contact.
  double time_to_contact = kNaN;
};

/// A total below this [m/s] is not taken for an approach: joints that stand still report positions
/// that differ by their encoders' last bits.
constexpr double kClosingNoiseFloor = 0.005;

/// Estimates how fast one source's obstacles approach, from the distances in its successive clouds.
///
/// One cloud adds one value: how far the obstacles have come toward the link. A line is fitted to
/// the newest 4, 5, ... 16 values (least squares). The speed is the slope of the shortest such line
/// that rises or falls significantly: Student's t of the slope exceeds the quantile that noise
/// alone exceeds once in 1000 cases. Longer lines take its place while each narrows the slope's
/// confidence interval and agrees with the line before. So a fast approach is told after few
/// clouds, and a slow one after many. A value that steps, because another obstacle appeared, fits
/// two levels better than a line, and is no speed.
class ApproachEstimate {
 public:
  static constexpr std::size_t kFewest = 4;  ///< values that a line needs
  static constexpr std::size_t kMost = 16;   ///< values that are kept
  static constexpr double kMaxGap = 2.0;     ///< [s] between values; a longer gap starts anew
  static constexpr double kMaxSpan = 1.0;    ///< [s] of a line of more than kFewest values

  /// @param stamp     [s] of the cloud; one that is not later than the last starts anew
  /// @param approach  [m] how far the obstacles have come, from any zero
  void add(double stamp, double approach);

  /// [m/s]; 0 where noise may explain all changes; NaN with fewer than kFewest values, and while
  /// the values step.
  double speed() const { return speed_; }
  double newest_stamp() const;  ///< [s] of the last value; -inf before the first

 private:
  double estimate() const;

  std::array<double, kMost> stamps_{}, values_{};  ///< rings; the newest is at next_ - 1
  std::size_t next_ = 0, count_ = 0;
  double speed_ = std::numeric_limits<double>::quiet_NaN();
};

/// Computes the closing rates of one link from its successive answers. One thread; allocates
/// nothing.
class ClosingSpeed {
 public:
  /// The cloud that holds the nearest point.
  struct Nearest {
    int source = -1;               ///< its number; -1: no point is near
    std::uint64_t generation = 0;  ///< differs for each cloud of the source
    double stamp = 0.0;            ///< [s] acquisition time
    bool stands_still = false;     ///< the source's points are stated not to move, as a map file's
  };

  /// Computes the rates. `robot` compares the pose with one that is 20 to 40 ms older where
  /// answers come fast, with the last one else, which must be less than 0.2 s old. `obstacles`
  /// comes from the last clouds of the nearest source (ApproachEstimate), less what the link's
  /// motion explains; it holds until the next cloud. Each of the last four nearest sources has its
  /// own estimate, so that another source's points never make a speed.
  /// @param time    [s] of the link poses
  /// @param result  the link's answer; one that is not NEAR or CONTACT ends the sequence
  /// @param X_FL    link frame -> fixed frame
  ClosingRates update(double time, const LinkProximity& result, const Eigen::Isometry3d& X_FL,
                      const Nearest& nearest);

  /// The same for two links of the robot, whose distance is free of a sensor's noise: `total` is
  /// how fast it falls, and has no parts.
  ClosingRates update_pair(double time, const LinkProximity& result);

 private:
  struct Pose {
    double time = -std::numeric_limits<double>::infinity();  ///< [s]; -inf: none
    Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();
    double distance = ClosingRates::kNaN;  ///< [m]
  };
  struct Track {
    int source = -1;
    std::uint64_t generation = 0;
    std::uint64_t used = 0;  ///< larger: used later
    ApproachEstimate approach;
  };

  const Pose* reference(double time) const;
  void remember(const Pose& now);
  Track* find_track(int source);
  double obstacle_speed(const Pose& now, const LinkProximity& result, const Nearest& nearest);

  Pose newer_, older_;  ///< two poses at least 20 ms apart
  Pose latest_;
  int latest_source_ = -1;
  std::uint64_t latest_generation_ = 0;
  double retreat_ = 0.0;  ///< [m] how far the link alone has gone from obstacles
  std::uint64_t uses_ = 0;
  std::array<Track, 4> tracks_;
};

}  // namespace ist
