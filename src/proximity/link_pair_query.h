#pragma once

#include <Eigen/Geometry>

#include "internal/geometry/relative_pose.h"
#include "ist_proximity/proximity/self_query.h"
#include "proximity/link_surface.h"
#include "proximity/opening_search.h"
#include "proximity/surface_pair_search.h"

namespace ist {

/// The distance of two links A and B, kept from pose to pose. First the distance of their surfaces
/// is found; where that is positive, whether one link is inside the other; where they are in
/// contact, how deep. Nothing is allocated after construction.
class LinkPairQuery {
 public:
  /// @param a, b, surface_a, surface_b  outlive this
  /// @param memory  of another query, which is void then: nothing is allocated where the other
  ///                one's links had holes too, or these have none; null: there is none
  LinkPairQuery(const LinkModel& a, const LinkModel& b, const LinkSurface& surface_a,
                const LinkSurface& surface_b, LinkPairQuery* memory = nullptr);

  /// The poses of the next steps. Bounds hold for them from here on.
  void move_to(const RigidPose& X_FA, const RigidPose& X_FB, const QueryConfig& config);

  /// Goes on until the tolerance is reached.
  /// @param steps  how many pairs of boxes may be looked at; reduced by those that were
  /// @returns false when the steps were used up first
  bool advance(int* steps);

  /// [m] Proven at this pose, whatever has been done so far; the margin is not taken off.
  double lower_bound() const;
  /// Whether it is known if one is inside the other.
  bool is_decided() const { return are_in_contact_ || are_apart_ || lower_bound() > 0.0; }
  /// The bounds that are known, at any time.
  void report(PairProximity* result) const;

 private:
  void decide_contact(int* steps);
  bool are_hulls_apart();
  bool find_inside_point();
  void search_spheres();
  void measure_depth();
  void measure_depth_at(const Eigen::Vector3d& q_B, bool is_of_a);
  void keep_deeper(const Eigen::Vector3d& q_B, const SignedDistance& found, bool is_of_a);
  void search_from_touch();
  void search_along_parts();
  void bound_by_slabs();
  double slab_width(const Eigen::Vector3d& up_B) const;
  double pose_uncertainty(double distance) const;
  double depth_limit() const;

  const LinkModel &a_, &b_;
  const LinkSurface &surface_a_, &surface_b_;
  SurfacePairSearch surfaces_;
  OpeningSearch openings_a_, openings_b_;
  bool is_finished_ = false;
  bool are_apart_ = false;  // no point of one is inside the other, at this pose
  bool are_in_contact_ = false;
  const bool are_closed_;  // both
  // [m] Of closed links, by the last pose: the distance changes no faster than they move.
  double kept_bound_;
  QueryConfig config_;
  double range_ = 0.0;  // [m] of the search: bounds lose the margin and the poses' errors later
  double drift_ = 0.0;  // of both poses
  Eigen::Isometry3d X_BA_ = Eigen::Isometry3d::Identity(), X_FB_ = Eigen::Isometry3d::Identity();
  bool has_pose_ = false;
  // A proven bound, and the deepest point found, in B's frame. They hold where the links are not
  // known to be apart.
  double depth_bound_, depth_distance_ = 0.0;  // [m]
  Eigen::Vector3d on_a_, on_b_, direction_;
};

}  // namespace ist
