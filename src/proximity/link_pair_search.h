#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "ist_proximity/geometry/solid.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/robot/robot_model.h"

namespace ist {

/// How deep two links that are in contact are in one another: the smallest signed distance of the
/// points of a link A to a link B, by best-first branch and bound in A's tree for the lower bound
/// and alternating projections for the upper bound.
class LinkPairSearch {
 public:
  /// @param config  outlives the search; max_distance and tolerance are read
  LinkPairSearch(const LinkModel& a, const LinkModel& b, const Eigen::Isometry3d& X_BA,
                 const QueryConfig& config);

  /// Visits so many parts and spheres that memory for them is at hand; the bounds of others count.
  void run();

  double lower_bound() const { return lower_bound_; }         ///< [m]
  const Eigen::Vector3d& p_BCa() const { return p_BCa_; }     ///< [m] of A, in B's frame
  const SignedDistance& closest() const { return closest_; }  ///< of that point to B

 private:
  static constexpr int kMaxSteps = 100;
  /// A part of A's tree that is still to be visited.
  struct Entry {
    double bound;        ///< [m] lower bound of the distance of the points of A that it covers
    std::int32_t child;  ///< >= 0: inner node; < 0: leaf ~child
    bool operator<(const Entry& other) const { return bound > other.bound; }  ///< least on top
  };

  double interior_allowance() const;
  double prune_bound() const;
  double cover_bound(const Eigen::Vector3d& p_B, double radius) const;
  void push(const Eigen::Vector3d& p_A, double radius, std::int32_t child);
  void prune(double bound);
  void visit_leaf(const SphereLeaf& leaf);
  void search_deeper(const Eigen::Vector3d& p_A, const SignedDistance& measured, double inner);
  void project_alternately(Eigen::Vector3d q_B);
  void set_closest(const Eigen::Vector3d& p_B, const SignedDistance& measured);

  const LinkModel &a_, &b_;
  const Eigen::Isometry3d X_BA_, X_AB_;
  const QueryConfig& config_;
  const bool has_holes_;
  std::array<Entry, 1 + kMaxSteps * kSphereWidth> queue_;  // a heap
  std::size_t size_ = 0;                                   // of it
  double lower_bound_ = std::numeric_limits<double>::infinity();
  SignedDistance closest_;  // of p_BCa_
  Eigen::Vector3d p_BCa_ = Eigen::Vector3d::Zero();
};

}  // namespace ist
