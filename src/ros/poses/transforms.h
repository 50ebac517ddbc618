#pragma once

#include <geometry_msgs/TransformStamped.h>
#include <ros/time.h>
#include <tf2/buffer_core.h>

#include <Eigen/Geometry>
#include <string>

namespace ist {

/// Where a frame is at one instant, or why that cannot be known. Never an identity in place of a
/// transform that is missing. Thread safe, never waits.
/// @param fixed   frame F
/// @param frame   frame T; equal to F needs no tf at all
/// @param time    0: the newest instant at which it is known
/// @param X_FT    T -> F, rigid; untouched on failure
/// @param stamp   may be null; the instant, 0 where every transform on the way is static
/// @returns empty on success, else a sentence with both frames
std::string look_up(const tf2::BufferCore& buffer, const std::string& fixed,
                    const std::string& frame, const ros::Time& time, Eigen::Isometry3d* X_FT,
                    ros::Time* stamp = nullptr);

/// Whether look_up() would find the frame; cheaper than its failure. `problem` is set where not.
bool is_known(const tf2::BufferCore& buffer, const std::string& fixed, const std::string& frame,
              const ros::Time& time, std::string* problem);

/// The newest transform, as look_up() at time 0, unless it is more than `max_age` [s] older than
/// `now`.
std::string look_up_newest(const tf2::BufferCore& buffer, const std::string& fixed,
                           const std::string& frame, const ros::Time& now, double max_age,
                           Eigen::Isometry3d* X_FT);

/// A message's transform; its quaternion may be off unit length by rounding (1e-3).
/// @returns empty on success, else what is wrong with the numbers
std::string to_isometry(const geometry_msgs::Transform& transform, Eigen::Isometry3d* X);

/// A sentence of tf2's without the full stop and space at its end, so that others can follow.
std::string trimmed(std::string tf_error);

/// tf2 knows frames without the slash that older programs put in front.
std::string without_slash(const std::string& frame);

}  // namespace ist
