#pragma once

#include <Eigen/Geometry>

#include "proximity/extent_measure.h"
#include "proximity/link_query_state.h"

namespace ist {

struct SearchOutcome;

/// The query of one link against every cloud and map of a scene. Usage: begin(), then warm_start()
/// if wanted, run() for one goal or several, then answer(). Functions neither allocate nor throw.
/// One thread.
///
/// run() is done where the bound that is kept from another pose is enough. Else it searches each
/// index (see Search), beginning with the front that is kept from another pose.
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

  /// Goes on from what earlier runs have proven.
  /// @param deadline  for this call in place of the question's
  /// @returns false: the deadline passed first; what is known by then still holds
  bool run(SnapshotSpan clouds, Goal goal, Deadline* deadline);

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
  /// After run(): whether an obstacle was found in range, or its sphere.
  bool is_in_range() const { return distance() <= link_.search.range() && !is_clear_of_extents(); }
  /// After run(): whether an obstacle may be inside, though none in range was found. What is not
  /// inside has a bound that is not below the range, but for rounding.
  bool may_be_inside() const {
    return !is_in_range() && link_.search.lower_bound() < -link_.search.rounding;
  }
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
    return sizeof *this + link_.kept.fronts.memory() + link_.kept.side_balls.memory();
  }

 private:
  bool search_points(SnapshotSpan clouds, Deadline* deadline);
  double proven(double bound) const;
  bool bound_may_hold() const;
  bool is_settled(SnapshotSpan clouds);
  void look_ahead();
  void keep_bound();
  void keep_answer();
  void count_outside_region();
  void take_kept_bound();
  double answer_error(double distance) const;
  double extent() const;  ///< [m] no point of the link is farther from its origin

  // Visits the indices of a cloud that holds obstacles for this link.
  template <class Visit>
  void for_each_index(SnapshotSpan clouds, std::size_t i, const Visit& visit) const {
    if (!clouds[i]->is_for(link_.context.model->name)) return;
    ist::for_each_index(*clouds[i], static_cast<std::int32_t>(i), link_.search.X_FL, visit);
  }

  template <class Obstacles>
  bool run(const Obstacles& obstacles);
  template <class Obstacles>
  void enter(const Obstacles& obstacles);
  template <class Bvh, class Measure>
  SearchOutcome search(const PosedIndex<Bvh>& obstacles, SearchFront* front, Measure* measure);
  SearchFront* front_of(std::uint64_t id, const Eigen::Isometry3d& X_OL,
                        const CloudSnapshot* spheres_of = nullptr);
  bool has_hardly_moved() const;
  bool begins_with_search() const;
  void measure_near_place(const PointObstacles& obstacles, const Eigen::Vector3d& p_FQ);
  static void measure_near_place(const BoxObstacles& obstacles, const Eigen::Vector3d& p_FQ);
  void measure_again(const PointObstacles& obstacles);
  void measure_again(const BoxObstacles& obstacles);

  // The spheres that obstacles stand for; see link_query_extent.cpp.
  void begin_extents(SnapshotSpan clouds, double other_extents);
  bool bound_extents(SnapshotSpan clouds, Deadline* deadline);
  double radius_of_closest(SnapshotSpan clouds) const;
  bool is_clear_of_extents() const;
  double contact_bound(SnapshotSpan clouds, double points, double limit);
  void measure_extent_again(SnapshotSpan clouds, ExtentSearch* spheres);
  bool search_extents(SnapshotSpan clouds, ExtentSearch* spheres);
  template <class Visit>
  bool for_each_extent(SnapshotSpan clouds, const Visit& visit, ExtentSearch* spheres);

  LinkQueryState link_;
};

}  // namespace ist
