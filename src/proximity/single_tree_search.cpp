// Branch and bound over the boxes of an index of points, for the whole link.

#include "proximity/single_tree_search.h"

#include <algorithm>
#include <array>
#include <limits>

#include "internal/bvh/bounding_sphere.h"
#include "internal/bvh/traversal_stack.h"
#include "internal/geometry/outside_margin.h"
#include "proximity/refinement.h"

namespace ist {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
// Boxes that are larger than so many of a cell's planes get no cell of their own.
constexpr double kLargestBox = 2.0;

// [m] The link's supporting plane may be this much too far.
constexpr double kPlaneSlack = 1e-5;
// [m] Rounding of a height above it, for each metre that the link is large.
constexpr double kPlaneRounding = 1e-12;
// Relative rounding of a distance to a triangle.
constexpr double kDepthRounding = 1e-9;

// The signed distance falls by no more than the distance between two points (but for holes, see
// PointDepth), so what the link's grid of signed distances holds near a box's centre bounds the
// whole box.
class SingleTreeSearch {
 public:
  SingleTreeSearch(const PointObstacles& obstacles, LinkQueryState* link)
      : obstacles_(obstacles),
        link_(*link),
        search_(link->search),
        kept_(link->kept.nodes),
        grid_(link->context.grid),
        tree_(link->context.tree()),
        R_LO_(obstacles.X_LO.linear()),
        is_closed_(link->context.solid().is_closed()),
        is_one_mesh_(is_one_mesh(link->context.solid())) {}

  bool run() {
    kept_.begin(obstacles_.bvh->build_id(), obstacles_.X_OL, link_.context.displacement);
    set_plane();
    push(obstacles_.bvh->root());
    while (true) {
      Frame& frame = stack_[size_ - 1];
      const int next = is_stopped_ ? -1 : frame.most_promising(search_.prune_bound());
      if (next < 0) {
        kept_.store(frame.child, frame.bounds);
        const Bound least = frame.least();
        if (--size_ == 0) {
          search_.prune(std::max(least.now, -tree_.radius()));
          return !is_stopped_;
        }
        stack_[size_ - 1].raise(least);
        continue;
      }
      frame.at = next;
      frame.is_open[static_cast<std::size_t>(next)] = false;
      if ((is_stopped_ = search_.deadline->passed())) continue;
      const std::int32_t child =
          obstacles_.bvh->nodes()[static_cast<std::size_t>(frame.child)].child[next];
      if (child >= 0) {
        push(child);
      } else {
        frame.raise(search_tile(~child, frame.bound(next)));
      }
    }
  }

 private:
  // A bound of a part of the obstacles, for now and as it is kept (ChildBounds).
  struct Bound {
    double now, floor, outside;  // [m]
  };

  // The children of a node, or the points of a tile.
  struct Frame {
    std::int32_t child;
    int count, at;
    ChildBounds bounds;
    std::array<double, kBoxWidth> now;      // [m] bounds of this query
    std::array<bool, kBoxWidth> is_open{};  // not expanded, or measured, yet

    Bound bound(int k) const {
      const auto i = static_cast<std::size_t>(k);
      return {now[i], bounds.floor[i], bounds.outside[i]};
    }
    void set(std::size_t k, const Bound& bound) {
      now[k] = bound.now;
      bounds.floor[k] = bound.floor;
      bounds.outside[k] = bound.outside;
    }
    void raise(std::size_t k, const Bound& bound) {
      if (bound.now > now[k]) set(k, bound);
    }
    void raise(const Bound& bound) { raise(static_cast<std::size_t>(at), bound); }

    // The open child with the least bound, if that is below the limit; else -1.
    int most_promising(double limit) const {
      int best = -1;
      for (int k = 0; k < count; ++k) {
        const auto i = static_cast<std::size_t>(k);
        if (!is_open[i] || !(now[i] < limit)) continue;
        limit = now[i];
        best = k;
      }
      return best;
    }
    Bound least() const {
      Bound least{kInfinity, kInfinity, kInfinity};
      for (std::size_t k = 0; k < static_cast<std::size_t>(count); ++k) {
        least.now = std::min(least.now, now[k]);
        least.floor = std::min(least.floor, bounds.floor[k]);
        least.outside = std::min(least.outside, bounds.outside[k]);
      }
      return least;
    }
  };

  // Points that are known to be outside a mesh with holes are the dual-tree traversal's, or too
  // far.
  static Bound bound(double floor, double outside) {
    return {outside > 0.0 ? floor : -kInfinity, floor, outside};
  }

  void push(std::int32_t child) {
    Frame& frame = stack_[size_++];
    const BoxNode& node = obstacles_.bvh->nodes()[static_cast<std::size_t>(child)];
    enter(child, node.count, &frame);
    const auto is_needed = [&](int k) {
      return frame.now[static_cast<std::size_t>(k)] < search_.prune_bound();
    };
    for (int k = 0; k < node.count; ++k) {
      if (is_needed(k)) grid_.prefetch(obstacles_.X_LO * bounding_sphere(node, k).center);
    }
    for (int k = 0; k < node.count; ++k) {
      if (is_needed(k)) frame.raise(static_cast<std::size_t>(k), bound_box(node, k));
    }
  }

  // The supporting plane of the whole link across the direction of the closest obstacle: a flat
  // scene is above it, or nowhere far below.
  void set_plane() {
    const SignedDistance& closest = search_.closest.exact;
    if (!is_closed_ || !(closest.distance < kInfinity)) return;
    plane_normal_L_ = closest.normal;
    plane_height_ = support(link_.context.solid(), closest.normal, kPlaneSlack,
                            closest.normal.dot(closest.witness)) +
                    kPlaneRounding * (1.0 + tree_.center().norm() + tree_.radius());
  }

  // [m] No point of a part has a smaller signed distance, by that plane: a point below it that is
  // inside the link meets the surface on its way up to the plane.
  double plane_bound(const SignedDistanceGrid::Part& part) const {
    if (plane_height_ == kInfinity) return -kInfinity;
    return plane_normal_L_.dot(part.center_L) - part.extent_against(plane_normal_L_) -
           plane_height_;
  }

  // Begins with the bounds that are kept.
  void enter(std::int32_t child, int count, Frame* frame) {
    frame->child = child;
    frame->count = count;
    if (!kept_.load(child, &frame->bounds)) frame->bounds.set_all(-kInfinity);
    for (std::size_t k = 0; k < kBoxWidth; ++k) {
      frame->now[k] = bound(frame->bounds.floor[k], frame->bounds.outside[k]).now;
      frame->is_open[k] = true;
    }
  }

  // [m] Points with a larger cover distance are outside.
  double outside_distance() const { return tree_.interior_gap() + 3.0 * search_.rounding; }

  Bound bound_box(const BoxNode& node, int k) {
    const BoundingSphere sphere = bounding_sphere(node, k);
    SignedDistanceGrid::Part part;
    part.center_O = sphere.center;
    part.center_L = obstacles_.X_LO * sphere.center;
    part.radius = sphere.radius;
    part.half = 0.5 * Eigen::Vector3d(node.max_x[k] - node.min_x[k], node.max_y[k] - node.min_y[k],
                                      node.max_z[k] - node.min_z[k]);
    part.R_LO = &R_LO_;
    PointTile scratch;
    if (node.child[k] < 0) {
      part.points = &obstacles_.bvh->tile(static_cast<std::size_t>(~node.child[k]), &scratch);
    }
    const double above = plane_bound(part);
    if (above >= search_.prune_bound()) return bound(above, kInfinity);
    SignedDistanceGrid::Cell* cell = grid_.find(part.center_L);
    if (cell != nullptr) {
      const double floor = grid_bound(cell, part);
      if (floor >= search_.prune_bound()) return bound(floor, kInfinity);
    }
    const Bound by_cover = cover_bound(part.center_L, part.radius);
    if (by_cover.now >= search_.prune_bound()) return by_cover;
    if (cell != nullptr) {
      const double margin = grid_.outside_margin(cell, part);
      if (margin > 0.0) return bound(kInfinity, margin);
    }
    if (cell != nullptr || part.radius > kLargestBox * grid_.plane_radius()) return by_cover;
    if (search_.deadline->passed()) return by_cover;
    cell = grid_.measure(part.center_L);
    if (cell == nullptr) return by_cover;
    const double floor = grid_bound(cell, part);
    if (floor < search_.prune_bound()) {
      const double margin = grid_.outside_margin(cell, part);
      if (margin > 0.0) return bound(kInfinity, margin);
    }
    return bound(floor, kInfinity);
  }

  // By the cover spheres: the places of a sphere are outside, or nothing is known.
  Bound cover_bound(const Eigen::Vector3d& center_L, double radius) const {
    const double enough = std::max(search_.prune_bound(), 0.0);
    const double outside =
        is_closed_ ? std::max(enough, outside_distance()) : outside_distance() + kMargin;
    if (tree_.cover_distance_exceeds(center_L, outside + radius)) {
      return is_closed_ ? bound(outside, kInfinity) : bound(kInfinity, kMargin);
    }
    if (!is_closed_ && tree_.cover_distance_exceeds(center_L, outside_distance() + radius)) {
      return bound(kInfinity, search_.rounding);
    }
    return bound(-kInfinity, kInfinity);
  }

  // [m] No point of a part has a smaller signed distance, by a cell of the grid.
  double grid_bound(SignedDistanceGrid::Cell* cell, const SignedDistanceGrid::Part& part) const {
    // No plane tells inside from outside near holes.
    const double bound = is_closed_ ? grid_.bound(cell, part, search_.prune_bound()).signed_distance
                                    : grid_.floor_bound(*cell, part.center_L, part.radius);
    return bound >= search_.prune_bound() ? bound : std::max(bound, grid_.depth_bound(*cell, part));
  }

  // Each point that is measured bounds its neighbours, so few of the sixteen have to be.
  Bound search_tile(std::int32_t tile_index, const Bound& tile_bound) {
    PointTile scratch;
    const PointTile& points = obstacles_.bvh->tile(static_cast<std::size_t>(tile_index), &scratch);
    enter(~tile_index, points.count, &tile_);
    for (int k = 0; k < points.count; ++k) {
      const auto i = static_cast<std::size_t>(k);
      p_OQ_[i] = points.point(k);
      p_LQ_[i] = obstacles_.X_LO * p_OQ_[i];
      tile_.raise(i, tile_bound);
      if (tile_.now[i] >= search_.prune_bound()) continue;
      tile_.raise(i, bound(plane_bound({p_LQ_[i]}), kInfinity));
      if (tile_.now[i] >= search_.prune_bound()) continue;
      SignedDistanceGrid::Cell* cell = grid_.find(p_LQ_[i]);
      if (cell != nullptr) tile_.raise(i, bound(grid_bound(cell, {p_LQ_[i]}), kInfinity));
    }
    int next;
    while ((next = tile_.most_promising(search_.prune_bound())) >= 0) {
      if ((is_stopped_ = search_.deadline->passed())) break;
      tile_.is_open[static_cast<std::size_t>(next)] = false;
      measure({tile_index, next});
    }
    kept_.store(~tile_index, tile_.bounds);
    return tile_.least();
  }

  // One point's bound bounds its neighbours, too: by how far they are from it, and by how far they
  // are from the triangle that is closest to it.
  void take(ObstacleId id, double floor, std::uint32_t triangle = PointDepth::kNoTriangle) {
    const auto i = static_cast<std::size_t>(id.lane);
    tile_.set(i, bound(floor, kInfinity));
    const bool is_high = floor > search_.prune_bound();
    for (std::size_t j = 0; j < static_cast<std::size_t>(tile_.count); ++j) {
      if (j == i) continue;
      if (is_high) tile_.raise(j, bound(floor - (p_LQ_[j] - p_LQ_[i]).norm(), kInfinity));
      if (triangle == PointDepth::kNoTriangle || !tile_.is_open[j]) continue;
      if (tile_.now[j] >= search_.prune_bound()) continue;
      const double depth = distance_to_triangle(link_.context.solid(), triangle, p_LQ_[j]);
      tile_.raise(j, bound(-(1.0 + kDepthRounding) * depth - kPlaneRounding, kInfinity));
    }
  }

  void measure(ObstacleId id) {
    const auto i = static_cast<std::size_t>(id.lane);
    const Eigen::Vector3d& p_LQ = p_LQ_[i];
    if (!is_closed_) {  // cover spheres cost less than a cell
      const Bound outside = cover_bound(p_LQ, 0.0);
      if (outside.now == kInfinity) return tile_.set(i, outside);
    }
    SignedDistanceGrid::Cell* cell = grid_.measure(p_LQ);
    NearSurface near = cell == nullptr ? NearSurface() : grid_.near_surface(cell, p_LQ);
    if (is_closed_) {
      if (near.side == NearSurface::Side::kOutside) {
        return take(id, PointRefinement(obstacles_, &link_).measure_outside(id, p_OQ_[i], p_LQ));
      }
    } else {
      const double margin = cell == nullptr ? 0.0 : grid_.outside_margin(cell, {p_LQ});
      if (margin > 0.0) return tile_.set(i, bound(kInfinity, margin));
      if (search_.prune_bound() <= 0.0 && take_outside(i, cell, &near)) return;
    }
    search_.count_exact();
    const PointDepth depth = point_depth(link_.context.solid(), p_LQ, -search_.prune_bound(), near);
    search_.offer(depth.exact, p_OQ_[i], obstacles_, id);
    take(id, depth.floor, depth.triangle);
    const bool is_known = depth.exact.distance < kInfinity;
    tile_.now[i] = is_known ? depth.exact.distance : std::max(depth.floor, search_.prune_bound());
  }

  // Takes a point that is outside a mesh with holes, and how far about it that lasts. Where it may
  // be that near to the surface, its depth is small enough in any case, which is found sooner.
  bool take_outside(std::size_t i, SignedDistanceGrid::Cell* cell, NearSurface* near) {
    if (!is_one_mesh_ || cell == nullptr) return false;
    const double distance = grid_.bound(cell, {p_LQ_[i]}, kInfinity).surface_distance;
    if (distance <= -search_.prune_bound() && search_.prune_bound() < 0.0) return false;
    search_.count_exact();
    const SideMargin found = outside_margin(link_.context.solid(), p_LQ_[i], distance);
    near->side = found.is_inside ? NearSurface::Side::kInside : NearSurface::Side::kOutside;
    if (found.is_inside) return false;
    tile_.set(i, found.margin > 0.0 ? Bound{0.0, kInfinity, found.margin}
                                    : Bound{0.0, -kInfinity, kInfinity});
    return true;
  }

  static constexpr double kMargin = 2e-3;  // [m] of what is proven to be outside, if it is cheap

  const PointObstacles& obstacles_;
  LinkQueryState& link_;
  LinkSearch& search_;
  NodeBounds& kept_;
  SignedDistanceGrid& grid_;
  const InnerSphereTree& tree_;
  const Eigen::Matrix3d R_LO_;
  const bool is_closed_, is_one_mesh_;
  Eigen::Vector3d plane_normal_L_ = Eigen::Vector3d::Zero();
  double plane_height_ = kInfinity;  // [m] of the supporting plane; inf: there is none
  bool is_stopped_ = false;
  std::array<Frame, kMaxBoxLevels> stack_;
  std::size_t size_ = 0;
  Frame tile_;
  std::array<Eigen::Vector3d, kPointWidth> p_OQ_, p_LQ_;
};

}  // namespace

bool search_single_tree(const PointObstacles& obstacles, LinkQueryState* link) {
  return SingleTreeSearch(obstacles, link).run();
}

}  // namespace ist
