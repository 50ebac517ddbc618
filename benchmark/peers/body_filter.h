#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <vector>

#include "peers/scene.h"

namespace ist::benchmark {

/// Drops a robot's own points as robot_body_filter does: each link is the convex hull of its mesh,
/// inflated (bodies::ConvexMesh), and each point is tested against a sphere about the robot, then
/// against the box and the planes of every link's hull.
class BodyFilter {
 public:
  /// @param padding  [m] by which hulls are inflated
  BodyFilter(const Robot& robot, double padding);

  /// Copies a frame; points on the robot become NaN.
  /// @param X_FL  by link
  void run(const Frame& frame, const std::vector<Eigen::Isometry3d>& X_FL, Frame* filtered) const;

 private:
  struct Body {
    Eigen::AlignedBox3f box;  ///< [m] in the link's frame, inflated
    /// A column (n, d) for each plane, inflated: points of the body have n.p + d <= 0. [m]
    Eigen::Matrix<float, 4, Eigen::Dynamic> planes;
    bool contains(const Eigen::Vector3f& p_L) const;
  };
  std::vector<Body> bodies_;
};

}  // namespace ist::benchmark
