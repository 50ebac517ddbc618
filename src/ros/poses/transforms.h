#pragma once

#include <ros/time.h>

#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <string>

#include "ist_proximity/geometry/span.h"
#include "ros/poses/transform_buffer.h"

namespace ist {

// Lookups in tf that never wait and never throw. An absent transform gives a sentence, never an
// identity. Frame names may begin with a slash. Thread safe.

/// Looks up the pose of a frame at one instant.
/// @param fixed   frame F
/// @param frame   frame T; tf is not needed where it is F itself
/// A pose that two publishers dispute is not known (see TransformBuffer).
/// @param time    0: the newest instant at which the pose is known
/// @param X_FT    T -> F, rigid; untouched on failure
/// @param stamp   may be null; the instant, 0 where every transform on the way is static
/// @returns empty on success, else a sentence with both frames
std::string look_up(const TransformBuffer& buffer, const std::string& fixed,
                    const std::string& frame, const ros::Time& time, Eigen::Isometry3d* X_FT,
                    ros::Time* stamp = nullptr);

/// Whether tf has the pose.
/// @param problem  set where the answer is false; may be null
bool is_known(const TransformBuffer& buffer, const std::string& fixed, const std::string& frame,
              const ros::Time& time, std::string* problem);

/// How a frame moved until its newest pose, which is older than the instant that it is asked for.
struct Lag {
  static constexpr std::size_t kMostWindows = 3;

  std::string frame;
  double age = 0.0;         ///< [s] of the pose at that instant; 0: it is not late
  double window = 1.0;      ///< [s] in each of which it moved by one of moves(), in frame F
  std::size_t windows = 0;  ///< of which its poses are known, the last one first
  std::array<Eigen::Isometry3d, kMostWindows> moved;
  /// The motion from where it is taken to be to where it was last, in frame F.
  Eigen::Isometry3d apart = Eigen::Isometry3d::Identity();

  Span<const Eigen::Isometry3d> moves() const { return {moved.data(), windows}; }
};

/// Looks up the pose at an instant, or else the newest one, as look_up_newest(). The windows of
/// `lag` are three, each as long as the age or 0.1 s, so that a frame that turns back is not taken
/// for one that stands; there are fewer where the frame is new. Before there is one, the pose is
/// not known. A lag that is used again keeps the memory of its name, so that nothing is allocated.
std::string look_up_near(const TransformBuffer& buffer, const std::string& fixed,
                         const std::string& frame, const ros::Time& time, double max_age,
                         Eigen::Isometry3d* X_FT, Lag* lag);

/// Looks up the newest pose, which must not be more than `max_age` [s] older than `now`. The age of
/// transforms that were stamped ahead of the clock counts from their receipt.
/// @param explained  as in with_cause()
std::string look_up_newest(const TransformBuffer& buffer, const std::string& fixed,
                           const std::string& frame, const ros::Time& now, double max_age,
                           Eigen::Isometry3d* X_FT, ros::Time* newest = nullptr,
                           bool* explained = nullptr);

/// Adds to a sentence on a pose that is not known why transforms are refused, where they are.
/// @param explained  receives whether the sentence names the cause; may be null
std::string with_cause(const TransformBuffer& buffer, const std::string& fixed,
                       const std::string& frame, const std::string& problem,
                       bool* explained = nullptr);

/// Why transforms between two frames are refused, though others give a pose, as a doubt about that;
/// empty: none is.
std::string doubt_of_pose(const TransformBuffer& buffer, const std::string& fixed,
                          const std::string& frame);

/// The sentence about a transform that is older than ~pose_timeout. Ages in seconds.
std::string too_old(const std::string& fixed, const std::string& frame, double age, double max_age);

}  // namespace ist
