#pragma once

#include <geometry_msgs/Transform.h>

#include <Eigen/Geometry>
#include <string>

#include "internal/geometry/limits.h"

namespace ist {

/// The farthest that a frame may be from another one that it is placed in [m].
constexpr double kMaxPosition = kMaxLength;

/// Converts a message's transform. The length of its quaternion may differ from 1 by rounding
/// (1e-3); the result is a rotation. Positions beyond kMaxPosition are refused.
/// @param X  the transform; untouched on failure
/// @returns empty on success, else what is wrong with the numbers
std::string to_isometry(const geometry_msgs::Transform& transform, Eigen::Isometry3d* X);

geometry_msgs::Transform to_message(const Eigen::Isometry3d& X);

/// Copies a vector to a message with members x, y, z (Point, Vector3).
template <typename Message>
void assign(const Eigen::Vector3d& v, Message* message) {
  message->x = v.x();
  message->y = v.y();
  message->z = v.z();
}

/// Converts a message with members x, y, z (Point, Vector3).
template <typename Message>
Eigen::Vector3d to_vector(const Message& message) {
  return {message.x, message.y, message.z};
}

}  // namespace ist
