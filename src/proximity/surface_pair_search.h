#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
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
/// The pairs that were pruned or measured are kept, the BVTT front. Each has the bound that was
/// proven for it and the path length at which it was: no point of A moves farther in B's frame than
/// the path grows. So a bound holds later, less the path since, and a pair is looked at again only
/// when its slack is used up (an event of expiry). The path grows from search to search, not from
/// pose to pose: where the least bound of all still answers, only the closest parts found last are
/// measured. A search from a kept front goes on to a part of the tolerance, so that the next poses
/// have slack.
///
/// Before pairs are searched, the convex hulls are asked: their distance is a lower bound, and
/// where the parts nearest to its ends are as near, it is the answer (convex bodies, and most
/// others that are apart). In the search, the hulls of the first levels' nodes bound pairs that
/// their boxes do not answer. The closest parts found last give the first upper bound at a new
/// pose. Where the memory is full, pairs are searched depth first, which needs none but a bounded
/// stack: nothing is allocated after construction.
class SurfacePairSearch {
 public:
  /// @param a, b      outlive this
  /// @param capacity  pairs that the front may hold, at least 16
  SurfacePairSearch(const SurfaceBvh& a, const SurfaceBvh& b, std::size_t capacity);
  /// The same, in the memory of another search, which is void then: nothing is allocated where that
  /// is large enough.
  SurfacePairSearch(const SurfaceBvh& a, const SurfaceBvh& b, std::size_t capacity,
                    SurfacePairSearch&& memory);

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

  /// [m] An upper bound at this pose, of two real points; inf: no parts have been measured; 0 or
  /// less: the surfaces intersect.
  double distance() const { return closest_.distance; }
  /// [m] Proven for this pose, at any time; 0 or more.
  double lower_bound() const;
  /// [m] Proven for this pose: a slab of this width lies between the convex hulls of A and B; 0 or
  /// less: not known.
  double separation() const { return plane_bound(); }
  /// The closest points found: on_p is on A and on_q on B, in B's frame.
  const ConvexDistance& closest() const { return closest_; }
  /// The parts that they are on, in B's frame; there must be any.
  ConvexPart part_a() const;
  const ConvexPart& part_b() const;
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
  enum class Start { kAnswered, kSearches, kNoSteps };
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

  /// Questions to the hulls of nodes.
  struct HullAnswers {
    int asked = 0, answered = 0;
  };
  /// The key of a pair of which nothing is proven.
  static constexpr double kUnproven = -1e-30;
  /// Sizes that are told apart, by powers of two.
  static constexpr int kHullSizes = 8;

  SurfacePairSearch(const SurfaceBvh& a, const SurfaceBvh& b, std::size_t capacity,
                    std::vector<Entry> queue, std::vector<Entry> kept);
  void start_anew();
  void set_reference();
  void begin_search();
  void prepare_boxes();
  void sort_front();
  void rebase_path();
  double path() const { return path_ + moved_; }
  /// [m] The bound that is left of a key.
  double bound_at(double key) const {
    return key < 0.0 ? 0.0 : std::max(key - path() * (1.0 + 1e-14), 0.0);
  }
  double plane_bound() const { return plane_bound_ - (path() - plane_path_) * (1.0 + 1e-14); }
  bool is_wanted(double bound) const { return bound < prune_bound_ || bound <= 0.0; }
  void update_prune_bound();
  double tolerance_at(double distance) const;
  void set_direction();
  bool is_leaf(const Pair& pair) const { return a_.child(pair.a) < 0 && b_.child(pair.b) < 0; }
  Expansion expand(const Pair& pair, std::uint8_t children, double prune_bound);
  /// A number below 0 for boxes that overlap, which orders small ones first: they lead to an
  /// intersection soonest.
  double overlap_order(const Pair& pair) const {
    return -1.0 / (a_.radius(pair.a) + b_.radius(pair.b) + 1e-30);
  }
  double bound_by_hulls(const Pair& pair);
  double measure(const Pair& pair);
  void descend();
  void prove_by_plane();
  /// Looks whether what is known answers, and begins the search otherwise.
  Start start(int* steps);
  bool prove_by_hulls();
  void keep_plane(double bound);
  void visit(const Entry& entry, int* steps);
  void visit_depth_first(const Entry& entry, int* steps);
  void keep(const Entry& entry);

  const SurfaceBvh &a_, &b_;
  const std::size_t capacity_;
  // The front: pairs that are wanted, a heap, and all others.
  std::vector<Entry> queue_, kept_;
  double least_kept_ = std::numeric_limits<double>::infinity();  // [m] key of kept_
  double path_ = 0.0;                                            // [m] at the reference
  double moved_ = 0.0;                                           // [m] since then
  Eigen::Isometry3d reference_X_BA_ = Eigen::Isometry3d::Identity();
  bool is_at_reference_ = false;
  bool has_jumped_ = false;    // to the reference: the front was dropped
  bool is_searching_ = false;  // at this pose
  bool has_boxes_ = false;     // prepare_boxes() was called at this pose
  HullSupport hull_support_;
  Eigen::Isometry3d X_BA_ = Eigen::Isometry3d::Identity(), X_AB_ = X_BA_;
  Eigen::Matrix3f R_BA_, R_AB_;
  Eigen::Vector3f p_BA_, p_AB_;
  Eigen::Vector3f n_B_, n_A_;                     // unit, from B to A: that of the closest points
  double rounding_ = 0.0, exact_rounding_ = 0.0;  // [m] of boxes and of parts
  Goal goal_;
  double prune_bound_ = 0.0;
  bool wants_slack_ = false;  // this search goes on to a part of the tolerance
  int looked_at_ = 0;         // pairs, in the last search
  std::array<HullAnswers, kHullSizes> hull_answers_{};  // by size, in the last search
  bool is_new_ = true;                                  // the front was started in the last search
  int cost_of_new_ = 0;       // pairs that were looked at when the front was started
  double plane_bound_ = 0.0;  // [m] of both surfaces, by the plane between the closest points
  double plane_path_ = 0.0;   // [m] where it was proven
  int next_plane_ = 0;        // when looked_at_ is this, the plane is tried
  double plane_tried_ = 0.0;  // [m] the distance for which the plane was tried last
  bool has_witness_ = false;
  SurfaceBvh::Slot witness_a_ = 0, witness_b_ = 0;
  ConvexDistance closest_;
};

}  // namespace ist
