#pragma once

#include <Eigen/Geometry>
#include <optional>

#include "proximity/dual_tree.h"
#include "proximity/extent_refinement.h"
#include "proximity/link_query_state.h"

namespace ist {

/// The query of one link: branch and bound, against every cloud and map of a scene. Usage: begin(),
/// then warm_start() if wanted, once run(), then answer(). Functions neither allocate nor throw.
/// One thread.
///
/// run() takes four steps for each index: an upper bound (upper_bound(), warm_start()), the search
/// of pairs that may be nearer (search()), the refinement of what survives (PointRefinement,
/// BoxRefinement), and the depth of what may be inside (search_depth()).
class LinkQuery {
 public:
  explicit LinkQuery(const LinkModel& link) : link_(link) {}

  /// Sets what is asked.
  /// @param X_FL         link frame -> fixed frame, rigid
  /// @param clouds       the ones that run() will get
  /// @param scene        their identity
  /// @param other_links  the upper bounds of other links: this link's distance matters only where
  ///                     it is less; inf: it matters
  struct OtherLinks {
    double distance = std::numeric_limits<double>::infinity();  ///< [m]
    double extents = std::numeric_limits<double>::infinity();   ///< [m] of obstacles' spheres
  };
  void begin(const Eigen::Isometry3d& X_FL, SnapshotSpan clouds, SceneId scene,
             const QueryConfig& config, const OtherLinks& other_links, QueryStatistics* statistics,
             Deadline* deadline);

  /// Measures the last answer's obstacle at the new pose, where it is still in the scene; else a
  /// point that is near to where it was.
  /// @param has_time  false: only the last answer's obstacle, which is one exact distance
  void warm_start(SnapshotSpan clouds, bool has_time = true);

  /// Proves a first lower bound of the link's distance, where none is kept: it takes some
  /// microseconds, and is kept for the poses to come. A link that is too near for it is not tried
  /// again at every step, nor is one that a search will prove more of. It is best after
  /// warm_start(): the plane across the obstacle that was measured may separate the link from all
  /// others.
  /// @param deadline  if it has passed, no search follows. It is asked at every step
  /// @param late      [s] it may be exceeded by so much
  void prove_first_bound(SnapshotSpan clouds, Deadline* deadline, double late);
  /// The same for a link that the deadline left without a positive bound, after run().
  void prove_bound_late(SnapshotSpan clouds, Deadline* deadline, double late);
  /// The same with more time, for links that prove_first_bound() has proven nothing of.
  void prove_bound_by_planes(SnapshotSpan clouds, Deadline* deadline);

  /// Asks again for what begin() has asked, with other tolerances; what run() has found since is
  /// the upper bound.
  void tighten(const QueryConfig& config);

  /// @param deadline  for this call in place of the question's
  /// @returns false: the deadline passed first; what is known by then still holds
  bool run(SnapshotSpan clouds, Deadline* deadline);

  /// The answer as it stands after warm_start() or run().
  void answer(SnapshotSpan clouds, LinkProximity* result);

  /// [m] Upper bound of the distance; inf: nothing was found.
  double distance() const { return link_.search.closest.exact.distance; }
  /// [m] Upper bound of the distance to the spheres that obstacles stand for.
  double extent_distance() const {
    return link_.search.has_extents ? link_.search.extents.upper : distance();
  }
  /// [m] How far apart these bounds of the spheres are.
  double extent_width() const {
    const ExtentResult& extents = link_.search.extents;
    return link_.search.has_extents ? extents.upper - extents.lower_bound : 0.0;
  }
  /// [m] Lower bound of the distance to obstacles' spheres, with every error and the margin taken
  /// off; inf where nothing is in range.
  double proven_bound() const { return proven(link_.search.extent_bound()); }
  /// [m] The same for the obstacles without their extents.
  double proven_points_bound() const { return proven(link_.search.lower_bound()); }
  /// After run(): whether the clouds' regions of interest hold all that this link has to know.
  bool is_inside_regions() const {
    return link_.search.region_bound >= link_.search.config.max_distance +
                                            link_.search.config.margin + link_.search.extent_range;
  }

  /// Takes the same link of another model, with the same geometry and perhaps another packing. All
  /// that was proven of the geometry stays.
  void set_link(const LinkModel& link);

  /// Forgets what was kept: the clouds of later queries may be others.
  void forget() { link_.kept.forget(); }

  /// [bytes] With its buffers, without the model.
  std::size_t memory() const {
    const LinkCoherence& kept = link_.kept;
    return sizeof *this + link_.context.grid.memory() + kept.nodes.memory() + kept.fronts.memory() +
           kept.field_fronts.memory() + kept.distances.memory() + kept.box_distances.memory() +
           kept.side_balls.memory() + kept.supports.memory();
  }

 private:
  bool search_points(SnapshotSpan clouds, Deadline* deadline);
  double proven(double bound) const;
  bool bound_may_hold() const;
  bool is_settled(SnapshotSpan clouds);
  void look_ahead();
  void set_grid_level();
  void keep_bound();
  void keep_bound(double bound, double cover_distance);
  void keep_answer();
  void count_outside_region();
  void take_kept_bound();
  double answer_error(double distance) const;
  double extent() const;  ///< [m] no point of the link is farther from its origin

  template <class Obstacles>
  bool run(const Obstacles& obstacles);
  template <class Obstacles>
  void enter(const Obstacles& obstacles);
  template <class BoundOfIndex>
  void prove_bound(SnapshotSpan clouds, const BoundOfIndex& bound_of_index);
  template <class Obstacles>
  double bound_by_planes(const Obstacles& obstacles, Deadline* deadline,
                         std::optional<double> late);
  void measure_near_place(const PointObstacles& obstacles, const Eigen::Vector3d& p_FQ);
  void measure_near_place(const BoxObstacles& obstacles, const Eigen::Vector3d& p_FQ);
  void measure_again(const PointObstacles& obstacles);
  void measure_again(const BoxObstacles& obstacles);
  bool is_crowded(const DualTreeResult& found) const;
  bool is_near(const PointObstacles& obstacles) const;
  static bool is_near(const BoxObstacles& obstacles);
  bool search_near(const PointObstacles& obstacles);
  static bool search_near(const BoxObstacles& obstacles);
  void search_inside(const PointObstacles& obstacles);
  void search_inside(const BoxObstacles& obstacles);
  void upper_bound(const PointObstacles& obstacles);
  void upper_bound(const BoxObstacles& obstacles);
  template <class Obstacles>
  DualTreeResult search(const Obstacles& obstacles);
  template <class Obstacles>
  void measure_closest(const Obstacles& obstacles);
  bool has_hardly_moved() const;
  bool is_too_near_for_field() const;
  bool is_field_too_coarse() const;
  bool begins_with_field() const;
  template <class Obstacles>
  bool search_by_field(const Obstacles& obstacles, bool* is_complete);
  template <class Bvh>
  DualTreeInput<Bvh> dual_tree_input(const PosedIndex<Bvh>& obstacles);

  // The spheres that obstacles stand for; see link_query_extent.cpp.
  void begin_extents(SnapshotSpan clouds, double other_extents);
  bool bound_extents(SnapshotSpan clouds, Deadline* deadline);
  double radius_of_closest(SnapshotSpan clouds) const;
  bool is_clear_of_extents() const;
  double contact_bound(SnapshotSpan clouds, double points, double limit);
  void measure_extent_again(SnapshotSpan clouds, ExtentSearch* spheres);
  bool search_extents(SnapshotSpan clouds, ExtentSearch* spheres);
  template <class Obstacles, class ExtentRefinement>
  bool search_extents(const Obstacles& obstacles, ExtentRefinement* refinement,
                      ExtentSearch* spheres);
  template <class Visit>
  bool for_each_extent(SnapshotSpan clouds, const Visit& visit, ExtentSearch* spheres);

  LinkQueryState link_;
};

}  // namespace ist
