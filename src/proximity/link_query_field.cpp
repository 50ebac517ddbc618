// The search of an index of points by the link's field of distances.

#include <algorithm>
#include <cmath>
#include <limits>

#include "internal/geometry/float_rounding.h"
#include "proximity/field_search.h"
#include "proximity/link_query.h"
#include "proximity/refinement.h"

namespace ist {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Nearer than so many of its smallest cells, a field without depths tells little, and another
// search begins at once.
constexpr double kTooNearInCells = 0.6;
// [m] A link that has moved farther has another nearest obstacle: the field finds it sooner than
// the last answer's obstacle is measured.
constexpr double kFarMoved = 0.03;
// Distances that differ by no more than this factor are about the same.
constexpr double kSameDistance = 1.5;
// The share of the tolerance that a search proves more than it has to: among slow motions the bound
// of a link then lasts for several steps.
constexpr double kAhead = 0.5;

}  // namespace

// Whether the link is about where it was when it was asked last.
bool LinkQuery::has_hardly_moved() const {
  const auto& last = link_.kept.last;
  return last.has_place &&
         link_.context.displacement.between(last.X_FL, link_.search.X_FL) < kFarMoved;
}

bool LinkQuery::is_too_near_for_field() const {
  const DistanceField& field = *link_.context.field();
  const double near = kTooNearInCells * static_cast<double>(field.levels().front().cell);
  return !field.has_depths() && link_.search.closest.exact.distance < near;
}

// Whether the field search gave up lately, at about this distance.
bool LinkQuery::is_field_too_coarse() const {
  const double distance = std::abs(link_.search.closest.exact.distance);
  const double too_coarse_at = std::abs(link_.kept.too_coarse_at);
  return has_hardly_moved() && distance > too_coarse_at / kSameDistance &&
         distance < kSameDistance * too_coarse_at;
}

// Whether the last answer's obstacle is of no use.
bool LinkQuery::begins_with_field() const {
  const DistanceField* field = link_.context.field();
  return field != nullptr && link_.search.config.deadline == 0.0 && !has_hardly_moved() &&
         (!link_.kept.last.was_inside || field->has_depths());
}

// @returns whether the search has answered for the index; if not, another one has to
template <>
bool LinkQuery::search_by_field(const PointObstacles& obstacles, bool* is_complete) {
  LinkSearch& search = link_.search;
  FieldSearchInput input;
  input.field = link_.context.field();
  if (input.field == nullptr || is_too_near_for_field() || is_field_too_coarse()) return false;
  input.bvh = obstacles.bvh;
  FieldQueue queue;
  input.queue = &queue;
  to_row_major(obstacles.X_LO, input.R_LO, input.p_LO);
  input.rounding = round_up(search.rounding);
  input.prune_bound = search.traversal_prune_bound();
  input.is_exact = search.config.tolerance == 0.0 && search.config.relative_tolerance == 0.0;
  if (has_hardly_moved()) input.ahead = static_cast<float>(kAhead * search.config.tolerance);
  input.planes = supporting_planes(obstacles.X_OL, link_);
  input.support = link_.kept.supports.max_support;
  // In contact the points inside are found best from the root.
  if (search.closest.exact.distance > 0.0) {
    input.front = link_.kept.field_fronts.find(obstacles.bvh->build_id());
  }
  if (input.front != nullptr) {
    input.front->begin(obstacles.bvh->build_id(), obstacles.X_OL, link_.context.displacement,
                       input.rounding);
  }
  PointRefinement refinement(obstacles, &link_);
  const FieldSearchResult found = search_field(input, &refinement);
  search.statistics->node_pairs += found.nodes;
  search.statistics->leaf_pairs += found.tiles;
  if (found.gave_up) {
    // The other searches begin with an obstacle that is about in the middle of the link's scene.
    if (!has_hardly_moved()) {
      measure_near_place(obstacles, search.X_FL * link_.context.tree().center());
    }
    if (found.has_inside && !input.field->has_depths()) {
      search.cover_bound = -kInfinity;
      search_inside(obstacles);
      *is_complete = !search.deadline->passed();
      return true;
    }
    set_grid_level();
    if (has_hardly_moved()) link_.kept.too_coarse_at = search.closest.exact.distance;
    return false;
  }
  search.prune(std::max(static_cast<double>(found.pruned_bound) - search.rounding,
                        -link_.context.deepest()));
  if (found.has_inside) {
    search.cover_bound = -kInfinity;
  } else if (!link_.context.solid().is_closed()) {
    const double outside = static_cast<double>(found.outside_bound) - search.rounding;
    search.cover_bound =
        std::min(search.cover_bound, link_.context.tree().interior_gap() + outside);
  }
  *is_complete = found.has_time;
  return true;
}
template <>
bool LinkQuery::search_by_field(const BoxObstacles& /*obstacles*/, bool* /*is_complete*/) {
  return false;
}

}  // namespace ist
