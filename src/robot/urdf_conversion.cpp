#include "urdf_conversion.h"

#include <cmath>

#include "internal/geometry/limits.h"
#include "ist_proximity/geometry/error.h"

namespace ist {
namespace {

JointType to_joint_type(int type) {
  switch (type) {
    case urdf::Joint::REVOLUTE:
      return JointType::kRevolute;
    case urdf::Joint::CONTINUOUS:
      return JointType::kContinuous;
    case urdf::Joint::PRISMATIC:
      return JointType::kPrismatic;
    case urdf::Joint::PLANAR:
      return JointType::kPlanar;
    case urdf::Joint::FLOATING:
      return JointType::kFloating;
    default:
      return JointType::kFixed;
  }
}

}  // namespace

Shape to_shape(const urdf::Geometry& geometry) {
  switch (geometry.type) {
    case urdf::Geometry::BOX: {
      const urdf::Vector3& size = static_cast<const urdf::Box&>(geometry).dim;
      return Box{{size.x, size.y, size.z}};
    }
    case urdf::Geometry::CYLINDER: {
      const auto& cylinder = static_cast<const urdf::Cylinder&>(geometry);
      return Cylinder{cylinder.radius, cylinder.length};
    }
    case urdf::Geometry::SPHERE: {
      return Sphere{static_cast<const urdf::Sphere&>(geometry).radius};
    }
    case urdf::Geometry::MESH:
      return TriangleMesh{};
    default:  // newer versions of urdfdom know more shapes
      throw ModelError("its shape is not supported; use box, cylinder, sphere or mesh");
  }
}

Eigen::Isometry3d to_isometry(const urdf::Pose& pose) {
  Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
  X.translation() << pose.position.x, pose.position.y, pose.position.z;
  const urdf::Rotation& q = pose.rotation;
  X.linear() = Eigen::Quaterniond(q.w, q.x, q.y, q.z).normalized().toRotationMatrix();
  return X;
}

JointDescription to_joint(const urdf::Joint& joint) {
  JointDescription result;
  result.name = joint.name;
  result.type = to_joint_type(joint.type);
  result.parent_link = joint.parent_link_name;
  result.child_link = joint.child_link_name;
  result.X_PJ = to_isometry(joint.parent_to_joint_origin_transform);
  result.axis << joint.axis.x, joint.axis.y, joint.axis.z;
  // Limits without a range, such as the 0 to 0 that exporters write, are none: the joint moves all
  // the same.
  if (joint.limits && joint.limits->lower < joint.limits->upper &&
      (joint.type == urdf::Joint::REVOLUTE || joint.type == urdf::Joint::PRISMATIC)) {
    // Limits farther out than any position counts are none.
    if (std::abs(joint.limits->lower) <= kMaxLength) result.lower = joint.limits->lower;
    if (std::abs(joint.limits->upper) <= kMaxLength) result.upper = joint.limits->upper;
  }
  if (joint.limits && joint.limits->velocity > 0.0) result.speed = joint.limits->velocity;
  if (joint.mimic) {
    result.mimic = Mimic{joint.mimic->joint_name, joint.mimic->multiplier, joint.mimic->offset};
  }
  return result;
}

}  // namespace ist
