// Depth of points inside a link.

#include <algorithm>
#include <array>
#include <limits>

#include "internal/bvh/bounding_sphere.h"
#include "internal/bvh/traversal_stack.h"
#include "proximity/depth_search.h"
#include "proximity/refinement.h"

namespace ist {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Branch and bound over the boxes of an index. The signed distance falls by no more than the
// distance between two points (but for holes, see PointDepth), so what the link's grid of signed
// distances holds near a box's centre bounds the whole box.
class PointDepthSearch {
 public:
  PointDepthSearch(const PointObstacles& obstacles, LinkQueryState* link)
      : obstacles_(obstacles), link_(*link), search_(link->search) {}

  void run() {
    stack_.push({-kInfinity, obstacles_.bvh->root()});
    while (!stack_.empty()) {
      const Entry entry = stack_.pop();
      if (entry.lower_bound >= search_.prune_bound()) {
        search_.prune(entry.lower_bound);
        continue;
      }
      if (search_.deadline->passed()) {
        search_.prune(-link_.context.tree().radius());
        return;
      }
      if (entry.child < 0) {
        search_tile(~entry.child, entry.lower_bound);
      } else {
        push_children(obstacles_.bvh->nodes()[static_cast<std::size_t>(entry.child)]);
      }
    }
  }

 private:
  struct Entry {
    double lower_bound;  // [m] no point below has a smaller signed distance
    std::int32_t child;
  };

  // The points of a tile and their bounds.
  struct Tile {
    int count;
    std::array<Eigen::Vector3d, kPointWidth> p_OQ, p_LQ;
    std::array<double, kPointWidth> lower_bound;  // [m] of signed distances
    std::array<bool, kPointWidth> is_open;        // not measured yet

    // One point's bound bounds its neighbours, too.
    void bound_neighbours(int from, double bound) {
      const auto i = static_cast<std::size_t>(from);
      for (std::size_t j = 0; j < static_cast<std::size_t>(count); ++j) {
        lower_bound[j] = std::max(lower_bound[j], bound - (p_LQ[j] - p_LQ[i]).norm());
      }
    }
    // The open point that may be deepest.
    int most_promising() const {
      int best = -1;
      for (int k = 0; k < count; ++k) {
        const auto i = static_cast<std::size_t>(k);
        if (is_open[i] &&
            (best < 0 || lower_bound[i] < lower_bound[static_cast<std::size_t>(best)]))
          best = k;
      }
      return best;
    }
  };

  // [m] Points with a larger cover distance are outside.
  double outside_distance() const {
    return link_.context.tree().interior_gap() + 3.0 * search_.rounding;
  }

  void push_children(const BoxNode& node) {
    const std::size_t first = stack_.size();
    for (int k = 0; k < node.count; ++k) {
      const BoundingSphere sphere = bounding_sphere(node, k);
      const double bound = lower_bound(obstacles_.X_LO * sphere.center, sphere.radius);
      if (bound == kInfinity) continue;
      if (bound >= search_.prune_bound()) {
        search_.prune(bound);
      } else {
        stack_.push_least_on_top<&Entry::lower_bound>(first, {bound, node.child[k]});
      }
    }
  }

  // [m] No point of a sphere has a smaller signed distance; inf: all its points are outside, and
  // the traversal has refined them. Cells of the grid are measured only near the link.
  double lower_bound(const Eigen::Vector3d& center_L, double radius) {
    SignedDistanceGrid& grid = link_.context.grid;
    SignedDistanceGrid::Cell* cell = grid.find(center_L);
    if (cell != nullptr) {
      const double bound = grid_bound(cell, center_L, radius);
      if (bound >= search_.prune_bound()) return bound;
    }
    if (link_.context.tree().cover_distance_exceeds(center_L, outside_distance() + radius)) {
      return kInfinity;
    }
    if (cell == nullptr) cell = grid.measure(center_L);
    return cell == nullptr ? -kInfinity : grid_bound(cell, center_L, radius);
  }

  // [m] No point of a sphere has a smaller signed distance, by a cell of the grid.
  double grid_bound(SignedDistanceGrid::Cell* cell, const Eigen::Vector3d& center_L,
                    double radius) const {
    const SignedDistanceGrid& grid = link_.context.grid;
    // No plane tells inside from outside near holes.
    const double bound =
        link_.context.solid().is_closed()
            ? grid.bound(cell, {center_L, radius}, search_.prune_bound()).signed_distance
            : grid.floor_bound(*cell, center_L, radius);
    return bound >= search_.prune_bound()
               ? bound
               : std::max(bound, grid.depth_bound(*cell, center_L, radius));
  }

  // Each point that is measured bounds its neighbours, so few of the sixteen have to be.
  void search_tile(std::int32_t tile_index, double tile_bound) {
    Tile tile;
    load(tile_index, tile_bound, &tile);
    for (int round = 0; round < tile.count; ++round) {
      const int next = tile.most_promising();
      const double bound = tile.lower_bound[static_cast<std::size_t>(next)];
      if (bound >= search_.prune_bound()) {
        search_.prune(bound);  // the least of those that are left
        return;
      }
      tile.is_open[static_cast<std::size_t>(next)] = false;
      measure({tile_index, next}, &tile);
    }
  }

  void load(std::int32_t tile_index, double tile_bound, Tile* tile) {
    PointTile scratch;
    const PointTile& points = obstacles_.bvh->tile(static_cast<std::size_t>(tile_index), &scratch);
    tile->count = points.count;
    for (int k = 0; k < tile->count; ++k) {
      const auto i = static_cast<std::size_t>(k);
      tile->p_OQ[i] = points.point(k);
      tile->p_LQ[i] = obstacles_.X_LO * tile->p_OQ[i];
      tile->lower_bound[i] = tile_bound;
      tile->is_open[i] = true;
      SignedDistanceGrid::Cell* cell = link_.context.grid.find(tile->p_LQ[i]);
      if (cell != nullptr) {
        tile->lower_bound[i] = std::max(tile_bound, grid_bound(cell, tile->p_LQ[i], 0.0));
      }
    }
    for (int k = 0; k < tile->count; ++k) {
      const auto i = static_cast<std::size_t>(k);
      if (tile->lower_bound[i] >= search_.prune_bound()) continue;
      const double kept =
          link_.kept.distances.find(obstacles_.bvh->build_id(), DistanceCache::Quantity::kSigned,
                                    ObstacleId{tile_index, k}.key(), tile->p_LQ[i]);
      if (kept > tile->lower_bound[i]) tile->bound_neighbours(k, kept);
    }
  }

  void measure(ObstacleId id, Tile* tile) {
    const auto i = static_cast<std::size_t>(id.lane);
    const Eigen::Vector3d& p_LQ = tile->p_LQ[i];
    if (link_.context.tree().cover_distance_exceeds(p_LQ, outside_distance())) return;
    NearSurface::Side side = NearSurface::Side::kUnknown;
    if (search_.prune_bound() <= 0.0) {
      side = PointRefinement(obstacles_, &link_).side(id, p_LQ);
      if (side == NearSurface::Side::kOutside) return search_.prune(0.0);
    }
    search_.count_exact();
    SignedDistanceGrid::Cell* cell = link_.context.grid.find(p_LQ);
    NearSurface near =
        cell == nullptr ? NearSurface() : link_.context.grid.near_surface(cell, p_LQ);
    if (side != NearSurface::Side::kUnknown) near.side = side;
    const PointDepth depth = point_depth(link_.context.solid(), p_LQ, -search_.prune_bound(), near);
    link_.kept.distances.store(obstacles_.bvh->build_id(), DistanceCache::Quantity::kSigned,
                               id.key(), p_LQ, depth.floor);
    if (depth.exact.distance < kInfinity) {
      search_.offer(depth.exact, tile->p_OQ[i], obstacles_, id);
    } else {
      search_.prune(std::max(depth.floor, search_.prune_bound()));
    }
    tile->bound_neighbours(id.lane, depth.floor);
  }

  const PointObstacles& obstacles_;
  LinkQueryState& link_;
  LinkSearch& search_;
  TraversalStack<Entry, stack_capacity(kMaxBoxLevels, kBoxWidth)> stack_;
};

}  // namespace

void search_depth(const PointObstacles& obstacles, LinkQueryState* link) {
  PointDepthSearch(obstacles, link).run();
}

}  // namespace ist
