#pragma once

#include <ros/time.h>

#include <Eigen/Geometry>
#include <string>

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

/// Whether look_up() would succeed. It costs less than a look_up() that fails.
/// @param problem  set where the answer is false
bool is_known(const TransformBuffer& buffer, const std::string& fixed, const std::string& frame,
              const ros::Time& time, std::string* problem);

/// Looks up the newest pose, which must not be more than `max_age` [s] older than `now`. The age of
/// transforms that were stamped ahead of the clock counts from their receipt.
std::string look_up_newest(const TransformBuffer& buffer, const std::string& fixed,
                           const std::string& frame, const ros::Time& now, double max_age,
                           Eigen::Isometry3d* X_FT);

/// Adds to a sentence on a pose that is not known why transforms are refused, where they are.
/// @param explained  receives whether the sentence names the cause; may be null
std::string with_cause(const TransformBuffer& buffer, const std::string& fixed,
                       const std::string& frame, const std::string& problem,
                       bool* explained = nullptr);

/// The sentence about a transform that is older than ~pose_timeout. Ages in seconds.
std::string too_old(const std::string& fixed, const std::string& frame, double age, double max_age);

}  // namespace ist
