#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <limits>
#include <optional>
#include <string>

namespace ist {

enum class JointType { kFixed, kRevolute, kContinuous, kPrismatic, kPlanar, kFloating };

/// A joint that follows another: its position is multiplier * (that one's) + offset.
struct Mimic {
  std::string joint;
  double multiplier = 1.0;
  double offset = 0.0;  ///< [rad, m]
};

/// A joint as the URDF states it.
struct JointDescription {
  std::string name;
  JointType type = JointType::kFixed;
  std::string parent_link, child_link;
  Eigen::Isometry3d X_PJ = Eigen::Isometry3d::Identity();  ///< joint frame J -> parent link P
  Eigen::Vector3d axis = Eigen::Vector3d::UnitX();         ///< in J; any length but 0
  std::optional<Mimic> mimic;
  /// [rad, m] infinite where the joint has none
  double lower = -std::numeric_limits<double>::infinity();
  double upper = std::numeric_limits<double>::infinity();
};

}  // namespace ist
