#pragma once

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "ist_proximity/geometry/span.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/robot/robot_model.h"
#include "ros/poses/transforms.h"

namespace ist {

/// Obstacles in frames whose newest poses are older than the links', and links that joints move
/// whose newest positions are. They may have moved since: as far as they move in that time, which
/// is taken off the bounds. One thread.
class LateFrames {
 public:
  /// All of these outlive this.
  /// @param X_FL   by link
  /// @param known  by link: whether it has a pose
  LateFrames(const RobotModel& robot, const std::vector<Eigen::Isometry3d>& X_FL,
             const std::vector<bool>& known)
      : robot_(robot), X_FL_(X_FL), known_(known) {}

  /// Begins a cycle: no frame is late.
  void begin();

  /// @param lag  outlives the cycle; one that is not late, or does not move, changes nothing
  void add(const Lag& lag);

  /// @param moved  [m] by link: how far its points may have moved; empty: none has. Outlives the
  ///               cycle
  void set_links(Span<const double> moved) { links_ = moved; }

  /// [m] The range in which obstacles may have come nearer than `max_distance` since.
  double range(double max_distance) const;

  /// Takes off the lower bounds what the frames may have moved.
  /// @param max_distance  [m] within which nothing is in CLEAR; answers are of range()
  /// @param answers       by link
  void lower(double max_distance, std::vector<LinkProximity>* answers);

  /// [m] How far obstacles within a sphere may have come since, to whatever link.
  /// @param lag  receives the reason where it is not 0; may be null
  double within(const Eigen::Vector3d& center, double radius, const Lag** lag = nullptr) const;

  /// Says so where lower() took more than `tolerance` [m] off; else empty.
  std::string doubt(double tolerance) const;

 private:
  double shift(std::size_t link, double bound, const Lag** lag) const;

  const RobotModel& robot_;
  const std::vector<Eigen::Isometry3d>& X_FL_;
  const std::vector<bool>& known_;
  std::vector<const Lag*> lags_;
  Span<const double> links_;
  double most_ = 0.0;            ///< [m] that lower() took off
  const Lag* latest_ = nullptr;  ///< the reason for that
};

}  // namespace ist
