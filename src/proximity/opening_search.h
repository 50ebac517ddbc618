#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cstddef>

#include "internal/geometry/openings.h"
#include "proximity/link_surface.h"
#include "proximity/surface_pair_search.h"

namespace ist {

/// Whether the surface of a link B passes through an opening of a link A, where no triangle of A is
/// in its path.
class OpeningSearch {
 public:
  /// @param a, b    outlive this
  /// @param memory  of another search, as for SurfacePairSearch
  OpeningSearch(const LinkSurface& a, const LinkSurface& b, OpeningSearch* memory);

  /// Knowledge at a pose.
  enum class Answer {
    kApart,   ///< no opening of A meets the surface of B
    kInside,  ///< a point of B's surface is inside A
    kUnknown  ///< not decided
  };

  /// [m] No point of A has moved farther in B's frame since the last call.
  void note_motion(double displacement);
  /// [m] Openings and surface are proven to be no nearer.
  void note_clearance(double clearance) { clearance_ = std::max(clearance_, clearance); }
  /// Whether openings and surface are apart for certain, without a search.
  bool stays_apart() const { return clearance_ > 0.0; }
  /// @param X_BA  frame of A -> that of B, rigid
  /// @param steps  reduced by the pairs of boxes that were looked at
  Answer decide(const Eigen::Isometry3d& X_BA, int* steps);
  /// [m] A point of B that is inside A, in B's frame; where the last answer was kInside.
  const Eigen::Vector3d& inside_B() const { return inside_B_; }

 private:
  const LinkSurface& a_;
  const bool is_closed_;
  SurfacePairSearch search_;
  double clearance_ = 0.0;  // [m] lower bound of the distance of openings and surface
  double moved_;            // [m] since search_.reference_pose()
  Eigen::Vector3d inside_B_ = Eigen::Vector3d::Zero();
};

}  // namespace ist
