// The search of one index, for its obstacles or for the spheres that they stand for.

#include <algorithm>
#include <type_traits>

#include "internal/geometry/float_rounding.h"
#include "internal/geometry/numbers.h"
#include "proximity/link_query.h"
#include "proximity/obstacle_measure.h"
#include "proximity/search.h"

namespace ist {
namespace {

// [m] A link that has moved farther has another nearest obstacle: the search finds it sooner than
// the last answer's obstacle is measured.
constexpr double kFarMoved = 0.03;
// The share of the tolerance that a search leaves where the link moves slowly: its bound then lasts
// for several steps.
constexpr double kSlowShare = 0.5;

}  // namespace

// Whether the link is about where it was when it was asked last.
bool LinkQuery::has_hardly_moved() const {
  const auto& last = link_.kept.last;
  return last.has_place &&
         link_.context.displacement.between(last.X_FL, link_.search.X_FL) < kFarMoved;
}

// Whether the last answer's obstacle is of no use.
bool LinkQuery::begins_with_search() const {
  return link_.context.field() != nullptr && link_.search.config.deadline == 0.0 &&
         !has_hardly_moved();
}

// The front of an index, at the pose of this search; null: there is no place for one.
// @param spheres_of  the cloud whose spheres are searched; null: obstacles themselves are
SearchFront* LinkQuery::front_of(std::uint64_t id, const Eigen::Isometry3d& X_OL,
                                 const CloudSnapshot* spheres_of) {
  SearchFront* front = link_.kept.fronts.find(id);
  if (front != nullptr) {
    if (spheres_of != nullptr) front->set_extents(spheres_of->extent, spheres_of->box_extent);
    front->begin(id, X_OL, link_.context.displacement, round_up(link_.search.rounding));
  }
  return front;
}

template <class Bvh, class Measure>
SearchOutcome LinkQuery::search(const PosedIndex<Bvh>& obstacles, SearchFront* front,
                                Measure* measure) {
  const LinkContext& context = link_.context;
  link_.kept.plane.turn_to(context.solid(), link_.search.closest.exact);
  SearchQueue queue;
  SearchInput input;
  input.queue = &queue;
  input.front = front;
  input.prune_bound = measure->traversal_prune_bound();
  input.link.field = context.field();
  input.link.tree = &context.tree();
  input.link.is_closed = context.solid().is_closed();
  input.link.rounding = round_up(link_.search.rounding);
  to_row_major(obstacles.X_LO, input.link.R_LO, input.link.p_LO);
  place_plane(link_, obstacles.X_OL, &input.link);
  if (link_.search.goal == Goal::kFree) place_sphere(context, obstacles.X_OL, &input.link);
  const SearchOutcome found = Search<Measure>(input, *obstacles.bvh, measure).run();
  link_.search.statistics->node_pairs += found.nodes;
  link_.search.statistics->leaf_pairs += found.tiles;
  return found;
}
template SearchOutcome LinkQuery::search(const PointObstacles&, SearchFront*,
                                         ExtentMeasure<PointObstacles>*);
template SearchOutcome LinkQuery::search(const BoxObstacles&, SearchFront*,
                                         ExtentMeasure<BoxObstacles>*);

// @returns false: the deadline passed
template <class Obstacles>
bool LinkQuery::run(const Obstacles& obstacles) {
  enter(obstacles);
  LinkSearch& search = link_.search;
  search.width_share = has_hardly_moved() ? kSlowShare : 1.0;
  SearchFront* front = front_of(obstacles.bvh->build_id(), obstacles.X_OL);
  typename MeasureOf<Obstacles>::Type measure(obstacles, &link_);
  const SearchOutcome found = this->search(obstacles, front, &measure);
  search.prune(std::max(static_cast<double>(found.pruned_bound) - search.rounding,
                        -link_.context.deepest()));
  const double outside = static_cast<double>(found.outside_bound) - search.rounding;
  search.outside_bound = found.has_inside ? -kInfinity : std::min(search.outside_bound, outside);
  return found.has_time;
}
template bool LinkQuery::run(const PointObstacles& obstacles);
template bool LinkQuery::run(const BoxObstacles& obstacles);

}  // namespace ist
