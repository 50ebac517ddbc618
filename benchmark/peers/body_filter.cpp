#include "peers/body_filter.h"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/convex_hull_3.h>

#include <limits>

namespace ist::benchmark {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;

Eigen::Vector3d vector(const Kernel::Point_3& p) { return {p.x(), p.y(), p.z()}; }

}  // namespace

BodyFilter::BodyFilter(const Robot& robot, double padding) {
  for (const TriangleMesh& mesh : robot.meshes) {
    std::vector<Kernel::Point_3> points;
    Body body;
    for (const Eigen::Vector3d& p : mesh.vertices) {
      points.emplace_back(p.x(), p.y(), p.z());
      body.box.extend(p.cast<float>());
    }
    CGAL::Surface_mesh<Kernel::Point_3> hull;
    CGAL::convex_hull_3(points.begin(), points.end(), hull);
    body.planes.resize(4, static_cast<Eigen::Index>(hull.number_of_faces()));
    Eigen::Index column = 0;
    for (const auto face : hull.faces()) {
      std::vector<Eigen::Vector3d> corners;
      for (const auto vertex : hull.vertices_around_face(hull.halfedge(face))) {
        corners.push_back(vector(hull.point(vertex)));
      }
      const Eigen::Vector3d n =
          (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalized();
      body.planes.col(column++) << n.cast<float>(),
          static_cast<float>(-n.dot(corners[0]) - padding);
    }
    const Eigen::Vector3f by = Eigen::Vector3f::Constant(static_cast<float>(padding));
    body.box = Eigen::AlignedBox3f(body.box.min() - by, body.box.max() + by);
    bodies_.push_back(body);
  }
}

bool BodyFilter::Body::contains(const Eigen::Vector3f& p_L) const {
  if (!box.contains(p_L)) return false;
  for (Eigen::Index i = 0; i < planes.cols(); ++i) {
    if (planes.col(i).head<3>().dot(p_L) + planes(3, i) > 0.0F) return false;
  }
  return true;
}

void BodyFilter::run(const Frame& frame, const std::vector<Eigen::Isometry3d>& X_FL,
                     Frame* filtered) const {
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
    const Eigen::Vector3f p_S(frame.data[i], frame.data[i + 1], frame.data[i + 2]);
    if (!((p_S - center_S).squaredNorm() <= radius_sq)) continue;  // NaN, too
    for (std::size_t link = 0; link < bodies_.size(); ++link) {
      if (!bodies_[link].contains(X_LS[link] * p_S)) continue;
      std::fill_n(&filtered->data[i], 3, std::numeric_limits<float>::quiet_NaN());
      break;
    }
  }
}

}  // namespace ist::benchmark
