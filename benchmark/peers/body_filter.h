#pragma once

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/convex_hull_3.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <limits>
#include <vector>

#include "peers/scene.h"

namespace ist::benchmark {

/// Drops a robot's own points as robot_body_filter does: each link is the convex hull of its mesh,
/// inflated (bodies::ConvexMesh), and each point is tested against a sphere about the robot, then
/// against the box and the planes of every link's hull.
class BodyFilter {
 public:
  /// @param padding  [m] by which hulls are inflated
  BodyFilter(const Robot& robot, double padding) {
    for (const TriangleMesh& mesh : robot.meshes) bodies_.emplace_back(mesh, padding);
  }

  /// Copies a frame; points on the robot become NaN.
  void run(const Frame& frame, const Poses& X_FL, Frame* filtered) const {
    *filtered = frame;
    std::vector<Eigen::Isometry3f> X_LS;
    Eigen::AlignedBox3f robot_S;
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
      X_LS.push_back((X_FL[i].inverse() * frame.X_FS).cast<float>());
      for (int corner = 0; corner < 8; ++corner) {
        robot_S.extend(X_LS[i].inverse() *
                       bodies_[i].box.corner(static_cast<Eigen::AlignedBox3f::CornerType>(corner)));
      }
    }
    const Eigen::Vector3f center_S = robot_S.center();
    const float radius_sq = 0.25F * robot_S.diagonal().squaredNorm();
    for (std::size_t i = 0; i < frame.data.size(); i += 4) {
      const Eigen::Vector3f p_S = frame.point(i / 4);
      if (!((p_S - center_S).squaredNorm() <= radius_sq)) continue;  // NaN, too
      for (std::size_t link = 0; link < bodies_.size(); ++link) {
        if (!bodies_[link].contains(X_LS[link] * p_S)) continue;
        std::fill_n(&filtered->data[i], 3, std::numeric_limits<float>::quiet_NaN());
        break;
      }
    }
  }

 private:
  using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;

  // A link's hull in the link's frame, inflated. [m]
  struct Body {
    Body(const TriangleMesh& mesh, double padding) {
      std::vector<Kernel::Point_3> points;
      for (const Eigen::Vector3d& p : mesh.vertices) {
        points.emplace_back(p.x(), p.y(), p.z());
        box.extend(p.cast<float>());
      }
      const Eigen::Vector3f by = Eigen::Vector3f::Constant(static_cast<float>(padding));
      box = Eigen::AlignedBox3f(box.min() - by, box.max() + by);
      CGAL::Surface_mesh<Kernel::Point_3> hull;
      CGAL::convex_hull_3(points.begin(), points.end(), hull);
      for (const auto face : hull.faces()) {
        std::vector<Eigen::Vector3d> corners;
        for (const auto vertex : hull.vertices_around_face(hull.halfedge(face))) {
          const Kernel::Point_3& p = hull.point(vertex);
          corners.emplace_back(p.x(), p.y(), p.z());
        }
        const Eigen::Vector3d n =
            (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalized();
        planes.emplace_back(n.cast<float>(), static_cast<float>(-n.dot(corners[0]) - padding));
      }
    }

    bool contains(const Eigen::Vector3f& p_L) const {
      return box.contains(p_L) && std::all_of(planes.begin(), planes.end(), [&](const auto& plane) {
               return plane.signedDistance(p_L) <= 0.0F;
             });
    }

    Eigen::AlignedBox3f box;
    std::vector<Eigen::Hyperplane<float, 3>> planes;
  };

  std::vector<Body> bodies_;
};

}  // namespace ist::benchmark
