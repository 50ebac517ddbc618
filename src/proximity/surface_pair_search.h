#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "internal/geometry/convex_part.h"
#include "internal/geometry/hull_distance.h"
#include "internal/geometry/surface_bvh.h"

namespace ist {

/// The distance of two surfaces A and B, kept from pose to pose: branch and bound over pairs of
/// boxes of their hierarchies, best first.
///
///     front <- the front of the last poses, or the pair of the roots
///     while the least bound in the front is below what is asked for
///         take the pair with that bound
///         two parts:  measure them, which lowers what is asked for
///         two boxes:  bound the children of the larger one beside the smaller one
///         front <- the parts, the children
///
/// All that is pruned or measured stays in the front, the BVTT front. Each pair has the bound that
/// was proven for it and the path length at which it was: no point of A moves farther in B's frame
/// than the path grows. So a bound holds later, less the path since. The path grows from search to
/// search, not from pose to pose: where the least bound of all still answers, only the closest
/// parts found last are measured.
///
/// Before pairs are searched, the convex hulls are asked: their distance is a lower bound, and
/// where the parts nearest to its ends are as near, it is the answer (convex bodies, and most
/// others that are apart). In the search, the hulls of the first levels' nodes bound pairs that
/// their boxes do not answer. A front that is full goes on depth first, which needs none but a
/// bounded stack: nothing is allocated after construction.
class SurfacePairSearch {
 public:
  /// @param a, b      outlive this
  /// @param capacity  pairs that the front may hold, at least 16
  /// @param memory    of another search, which is void then: nothing is allocated where that is
  ///                  large enough; null: there is none
  SurfacePairSearch(const SurfaceBvh& a, const SurfaceBvh& b, std::size_t capacity,
                    SurfacePairSearch* memory = nullptr);

  /// The question: bounds that differ by `tolerance` at most where the surfaces are nearer than
  /// `range`; whether they intersect is always decided.
  struct Goal {
    double range = std::numeric_limits<double>::infinity();  ///< [m] > 0
    double tolerance = 0.0;                                  ///< [m]
    double relative_tolerance = 0.0;  ///< ratio to the distance, where that is wider
  };

  /// The pose of the next runs.
  /// @param X_BA          A's frame -> B's, rigid
  /// @param displacement  [m] no point of A is farther from where it was in B's frame at
  ///                      reference_pose(); inf: not known, everything is searched anew
  void move_to(const Eigen::Isometry3d& X_BA, double displacement);

  /// Searches until the goal is reached.
  /// @param steps  how many pairs may be looked at; reduced by those that were
  /// @returns false when the steps were used up first; the next call continues
  bool run(const Goal& goal, int* steps);

  /// A's frame -> B's at the last run() that what was known did not answer.
  const Eigen::Isometry3d& reference_pose() const { return reference_X_BA_; }
  /// Whether reference_pose() is this pose.
  bool is_at_reference() const { return is_at_reference_; }

  /// Visits parts that are near one another.
  class Visitor {
   public:
    virtual ~Visitor() = default;
    /// @param part_a  in B's frame, as part_b
    /// @returns false to end the search
    virtual bool visit(const ConvexPart& part_a, const ConvexPart& part_b) = 0;
  };
  /// Visits all pairs of parts that intersect at this pose, or are no farther than `margin` [m].
  /// @param steps  as for run()
  /// @returns false when the visitor or the steps ended the search
  bool visit_near(double margin, Visitor* visitor, int* steps);

  /// [m] An upper bound at this pose, of two real points; inf: there are no parts; 0 or less: the
  /// surfaces intersect.
  double distance() const { return closest_.distance; }
  /// [m] Proven for this pose, at any time; 0 or more.
  double lower_bound() const;
  /// [m] Proven for this pose: a slab of this width lies between the convex hulls of A and B; 0 or
  /// less: not known.
  double separation() const { return plane_key_ - path() * (1.0 + 1e-14); }
  /// The closest points found: on_p is on A and on_q on B, in B's frame.
  const ConvexDistance& closest() const { return closest_; }
  /// The parts that they are on, in B's frame; there must be any.
  ConvexPart part_a() const { return posed(a_.part(witness_a_), X_BA_); }
  const ConvexPart& part_b() const { return b_.part(witness_b_); }
  /// [m] Bounds of parts that were measured may be wrong by this much.
  double rounding() const { return exact_rounding_; }

 private:
  struct Entry {
    /// [m] a bound plus the path length where it was proven; below 0: none, and the larger the
    /// boxes the nearer to 0
    double key;
    SurfaceBvh::Slot a, b;
    std::uint8_t children;  ///< by bit, those that it is about; 0: the pair itself
    bool operator<(const Entry& other) const { return key > other.key; }  ///< least on top
  };
  /// A pair and its bound at this pose.
  struct Pair {
    double bound;
    SurfaceBvh::Slot a, b;
  };
  /// The children of a pair.
  struct Expansion {
    Pair wanted[SurfaceBvh::kWidth];
    int count;              ///< of wanted ones
    std::uint8_t unwanted;  ///< by bit
    double least_unwanted;  ///< [m] least bound of those; inf: none
  };
  /// The key of a pair of which nothing is proven.
  static constexpr double kUnproven = -1e-30;

  void start_anew();
  void begin_search();
  void set_direction();
  double path() const { return path_ + moved_; }
  /// [m] The bound that is left of a key.
  double bound_at(double key) const {
    return key < 0.0 ? 0.0 : std::max(key - path() * (1.0 + 1e-14), 0.0);
  }
  double key_of(double bound) const { return bound > 0.0 ? bound + path() : kUnproven; }
  bool is_wanted(double bound) const { return bound < prune_bound_ || bound <= 0.0; }
  double tolerance_at(double distance) const;
  void update_prune_bound();
  bool is_empty() const { return a_.empty() || b_.empty(); }
  bool is_leaf(const Pair& pair) const { return a_.child(pair.a) < 0 && b_.child(pair.b) < 0; }
  ConvexPart other_part(const Pair& pair, bool of_a) const;
  Expansion expand(const Pair& pair, std::uint8_t children, double prune_bound);
  /// A number below 0 for boxes that overlap, which orders small ones first: they lead to an
  /// intersection soonest.
  double overlap_order(const Pair& pair) const {
    return -1.0 / (a_.radius(pair.a) + b_.radius(pair.b) + 1e-30);
  }
  double bound_by_hulls(const Pair& pair);
  double measure(SurfaceBvh::Slot a, SurfaceBvh::Slot b);
  void prove_by_plane();
  void prove_by_hulls();
  void keep_plane(double bound) { plane_key_ = std::max(plane_key_, bound + path()); }
  bool visit(const Entry& entry, int* steps);
  void push(const Entry& entry);
  void set_aside(const Entry& entry);

  const SurfaceBvh &a_, &b_;
  const std::size_t capacity_;
  std::vector<Entry> front_;  // a heap
  // Parts of the front that are not to be looked at again at this pose: they were measured, or the
  // front has no place for them.
  std::vector<Entry> aside_;
  double least_aside_ = std::numeric_limits<double>::infinity();  // [m] key
  bool is_complete_ = true;  // false: there was no place here either, so the front is to be dropped
  double path_ = 0.0;        // [m] at the reference
  double moved_ = 0.0;       // [m] since then
  Eigen::Isometry3d reference_X_BA_ = Eigen::Isometry3d::Identity();
  bool is_at_reference_ = false;  // so the search has begun at this pose
  HullSupport hull_support_;
  Eigen::Isometry3d X_BA_ = Eigen::Isometry3d::Identity(), X_AB_ = X_BA_;
  Eigen::Matrix3f R_BA_, R_AB_;
  Eigen::Vector3f p_BA_, p_AB_;
  Eigen::Vector3f n_B_, n_A_;                     // unit, from B to A: that of the closest points
  double rounding_ = 0.0, exact_rounding_ = 0.0;  // [m] of boxes and of parts
  Goal goal_;
  double prune_bound_ = 0.0;
  int looked_at_ = 0;       // pairs, in the last search
  bool is_new_ = true;      // the front was started in the last search
  int cost_of_new_ = 0;     // pairs that were looked at when the front was started
  double plane_key_ = 0.0;  // [m] of both surfaces, by the plane between the closest points
  SurfaceBvh::Slot witness_a_ = SurfaceBvh::kRoot, witness_b_ = SurfaceBvh::kRoot;
  ConvexDistance closest_;
};

}  // namespace ist
