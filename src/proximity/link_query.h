#pragma once

#include <Eigen/Geometry>

#include "proximity/dual_tree.h"
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
  /// @param scene        the identity of the clouds that run() will get
  /// @param other_links  [m] the upper bound of other links: this link's distance matters only
  /// where
  ///                     it is less; inf: it matters
  void begin(const Eigen::Isometry3d& X_FL, SceneId scene, const QueryConfig& config,
             double other_links, QueryStatistics* statistics);

  /// Measures the last answer's obstacle at the new pose, where it is still in the scene; else a
  /// point that is near to where it was.
  /// @param has_time  false: only the last answer's obstacle, which is one exact distance
  void warm_start(SnapshotSpan clouds, bool has_time = true);

  /// Asks again for what begin() has asked, with other tolerances; what run() has found since is
  /// the upper bound.
  void tighten(const QueryConfig& config);

  /// @returns false: the deadline passed first; what is known by then still holds
  bool run(SnapshotSpan clouds, Deadline* deadline);

  /// The answer as it stands after warm_start() or run().
  void answer(SnapshotSpan clouds, LinkProximity* result);

  /// [m] Upper bound of the distance; inf: nothing was found.
  double distance() const { return link_.search.closest.exact.distance; }
  /// [m] Lower bound of the distance, with every error and the margin taken off; inf where nothing
  /// is in range.
  double proven_bound() const;
  /// After run(): whether the clouds' regions of interest hold all that this link has to know.
  bool is_inside_regions() const {
    return link_.search.region_bound >=
           link_.search.config.max_distance + link_.search.config.margin;
  }

  /// Takes the same link of another model, with the same geometry and perhaps another packing. All
  /// that was proven of the geometry stays.
  void set_link(const LinkModel& link);

  /// Forgets what was kept: the clouds of later queries may be others.
  void forget() { link_.kept.forget(); }

 private:
  bool is_settled(SnapshotSpan clouds);
  void look_ahead();
  void keep_bound();
  void keep_answer();
  void count_outside_region();
  void take_kept_bound();
  double answer_error(double distance) const;
  double extent() const;  ///< [m] no point of the link is farther from its origin

  template <class Obstacles>
  bool run(const Obstacles& obstacles);
  template <class Obstacles>
  void enter(const Obstacles& obstacles);
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
  template <class Bvh>
  DualTreeInput<Bvh> dual_tree_input(const PosedIndex<Bvh>& obstacles);

  LinkQueryState link_;
};

}  // namespace ist
