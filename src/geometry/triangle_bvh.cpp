#include "internal/geometry/triangle_bvh.h"

#include <algorithm>
#include <cmath>

#include "geometry/triangle_bvh_builder.h"
#include "geometry/triangle_kernels.h"

namespace ist {
namespace {

// A part of the surface is replaced by its expansion where the point is at least beta radii away
// from it (Barill et al. 2018).
constexpr float kQuickBeta = 2.0F;
constexpr float kBeta = 6.0F;

}  // namespace

TriangleBvh::TriangleBvh(const TriangleMesh& mesh, const CancelRequest& cancelled) {
  TriangleBvhBuilder(mesh, cancelled, this).run();
}

TriangleBvh::View TriangleBvh::view() const {
  return {boxes_.data(),
          slabs_.data(),
          moments_.data(),
          leaves_.data(),
          triangles_.data(),
          bounds_.center(),
          0.5 * bounds_.sizes().norm()};
}

ClosestPoint TriangleBvh::closest(const Eigen::Vector3d& p_M, double max_distance_sq,
                                  const Eigen::Vector3d& outward_hint_M, double early_out_sq,
                                  double tolerance) const {
  ClosestPoint closest;
  closest.lower_bound = std::sqrt(max_distance_sq);
  if (!triangles_.empty()) {
    find_closest(view(), p_M, max_distance_sq, outward_hint_M, early_out_sq, tolerance, &closest);
  }
  return closest;
}

double TriangleBvh::support(const Eigen::Vector3d& n_M, double tolerance, double at_least) const {
  return triangles_.empty() ? at_least : find_support(view(), n_M, nullptr, tolerance, at_least);
}

double TriangleBvh::support_in_sphere(const Eigen::Vector3d& center_M, double radius,
                                      const Eigen::Vector3d& n_M, double tolerance,
                                      double at_least) const {
  if (triangles_.empty()) return at_least;
  const SupportSphere sphere{center_M, radius};
  const double at_center = n_M.dot(center_M);
  return find_support(view(), n_M, &sphere, tolerance, at_least + at_center) - at_center;
}

double TriangleBvh::winding_number(const Eigen::Vector3d& p_M) const {
  return triangles_.empty() ? 0.0 : sum_winding(view(), p_M, kBeta).number;
}

// The error grows with the surface that is seen, whichever way it is turned: where several sheets
// lie one behind another their errors add up, and their numbers may cancel.
double TriangleBvh::quick_winding_number(const Eigen::Vector3d& p_M, double* error) const {
  if (triangles_.empty()) {
    if (error != nullptr) *error = 0.0;
    return 0.0;
  }
  const WindingSum sum = sum_winding(view(), p_M, kQuickBeta);
  if (error != nullptr) *error = kQuickWindingError * std::max(1.0, sum.far_size);
  return sum.number;
}

bool TriangleBvh::is_inside(const Eigen::Vector3d& p_M) const {
  double error;
  const double w = quick_winding_number(p_M, &error);
  if (std::abs(w - 0.5) > error) return w > 0.5;
  return winding_number(p_M) > 0.5;
}

}  // namespace ist
