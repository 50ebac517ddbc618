#include "proximity/supporting_planes.h"

#include <limits>

#include "proximity/refinement.h"

namespace ist {
namespace {

// Directions this close [rad] serve as one: 5 cm off the axis that makes 0.5 mm.
constexpr double kSameDirection = 0.01;
// [m] A plane may be this much too far.
constexpr double kSupportSlack = 1e-5;

}  // namespace

bool update_supporting_planes(const Eigen::Isometry3d& X_OL, LinkQueryState* link,
                              SupportingPlanes* planes) {
  const SignedDistance& closest = link->search.closest.exact;
  LinkCoherence& kept = link->kept;
  if (!(closest.distance > 0.0) || closest.distance == std::numeric_limits<double>::infinity() ||
      !((closest.normal - kept.plane_normal_L).squaredNorm() > kSameDirection * kSameDirection)) {
    return false;
  }
  kept.plane_normal_L = closest.normal;
  const Eigen::Vector3f normal = closest.normal.cast<float>();
  const double at_witness = closest.normal.dot(closest.witness);
  const double support =
      ist::support(link->context.solid(), closest.normal, kSupportSlack, at_witness);
  kept.supports.set_direction(normal.data(), round_up(support));
  *planes = supporting_planes(X_OL, *link);
  return true;
}

SupportingPlanes supporting_planes(const Eigen::Isometry3d& X_OL, const LinkQueryState& link) {
  SupportingPlanes planes;
  if (link.kept.plane_normal_L.isZero()) return planes;
  const Eigen::Vector3d normal_O = X_OL.linear() * link.kept.plane_normal_L;
  for (int axis = 0; axis < 3; ++axis) planes.normal[axis] = static_cast<float>(normal_O[axis]);
  planes.offset = round_up(normal_O.dot(X_OL.translation()) + link.search.rounding);
  return planes;
}

}  // namespace ist
