// Depth of solid boxes inside a link.

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

// [m] Parts of boxes that cannot be deeper than what was found by more than this are not divided.
constexpr double kDepthResolution = 5e-4;
// [m] A distance up to this is contact.
constexpr double kContact = 1e-9;

double radius_of(const Eigen::AlignedBox3d& box) { return 0.5 * box.sizes().norm(); }

class BoxDepthSearch {
 public:
  BoxDepthSearch(const BoxObstacles& obstacles, LinkQueryState* link)
      : obstacles_(obstacles), link_(*link), search_(link->search), refinement_(obstacles, link) {}

  // Visits the boxes that the traversal has left.
  void run(const BoxesInside& boxes) {
    for (const BoxesInside::Entry& entry : boxes) {
      if (search_.deadline->passed()) return give_up();
      search_box(entry.id, entry.found, false);
    }
  }

  // Visits every box that may hold points inside the link.
  void run() {
    stack_.push({-kInfinity, obstacles_.bvh->root()});
    while (!stack_.empty()) {
      const std::int32_t child = stack_.pop().child;
      if (search_.deadline->passed()) return give_up();
      if (child < 0) {
        search_tile(~child);
      } else {
        push_children(obstacles_.bvh->nodes()[static_cast<std::size_t>(child)]);
      }
    }
  }

 private:
  struct Entry {
    double cover_distance;  // [m] of the node's bounding sphere, less what is outside for certain
    std::int32_t child;
  };

  // A part of a box, measured at its centre.
  struct Cell {
    Eigen::AlignedBox3d box;   // frame O
    double lower_bound = 0.0;  // [m] none of its points has a smaller signed distance
  };

  // [m] Points with a larger cover distance are outside.
  double outside_distance() const {
    return link_.context.tree().interior_gap() + 3.0 * search_.rounding;
  }

  void give_up() { search_.prune(-link_.context.deepest()); }

  void push_children(const BoxNode& node) {
    const std::size_t first = stack_.size();
    for (int k = 0; k < node.count; ++k) {
      const BoundingSphere sphere = bounding_sphere(node, k);
      const double near = outside_distance() + sphere.radius;
      const Eigen::Vector3d center_L = obstacles_.X_LO * sphere.center;
      // The traversal has refined what farther boxes hold; it is outside.
      if (link_.context.tree().cover_distance_exceeds(center_L, near)) continue;
      const double distance = link_.context.tree().cover_distance(center_L, near);
      stack_.push_least_on_top<&Entry::cover_distance>(first, {distance - near, node.child[k]});
    }
  }

  void search_tile(std::int32_t tile) {
    const int count = obstacles_.bvh->tiles()[static_cast<std::size_t>(tile)].count;
    for (int lane = 0; lane < count; ++lane) {
      if (search_.deadline->passed()) return give_up();
      search_box({tile, lane});
    }
  }

  void search_box(ObstacleId id) {
    const Eigen::AlignedBox3d box = box_O(*obstacles_.bvh, id);
    const Eigen::Vector3d center_L = obstacles_.X_LO * box.center();
    const double cover = link_.context.tree().cover_distance(center_L, outside_distance());
    if (cover > outside_distance() + radius_of(box)) return;
    ++search_.statistics->exact_evaluations;
    const BoxDistance found = distance_to_box(link_.context.solid(), box, obstacles_.X_OL,
                                              std::max(search_.closest.exact.distance, kContact));
    search_box(id, found, cover > outside_distance());
  }

  // @param is_center_outside  what is known of it
  void search_box(ObstacleId id, const BoxDistance& found, bool is_center_outside) {
    const Eigen::AlignedBox3d box = box_O(*obstacles_.bvh, id);
    if (found.distance > 0.0 &&
        (is_center_outside || !link_.context.solid().is_inside(obstacles_.X_LO * box.center()))) {
      return refinement_.take_outside(found, id);
    }
    const Cell whole = make_cell(box, id);
    if (whole.lower_bound >= search_.prune_bound()) return search_.prune(whole.lower_bound);
    if (found.distance == 0.0) refinement_.take_overlap(found, id);
    divide(whole, id);
  }

  Cell make_cell(const Eigen::AlignedBox3d& box, ObstacleId id) {
    const Eigen::Vector3d p_OQ = box.center(), p_LQ = obstacles_.X_LO * p_OQ;
    ++search_.statistics->exact_evaluations;
    const SignedDistance measured = link_.context.solid().signed_distance(p_LQ);
    search_.offer(measured, p_OQ, obstacles_, id);
    return {box, distance_floor(link_.context.solid(), p_LQ, measured) - radius_of(box)};
  }

  // Best first: the part that may be deepest is halved across its longest edge, until no part can
  // be deeper by more than the resolution, or the cells of this link are used up.
  void divide(const Cell& whole, ObstacleId id) {
    std::array<Cell, kMaxBoxCells + 2> heap;
    std::size_t size = 0;
    const auto shallower = [](const Cell& a, const Cell& b) {
      return a.lower_bound > b.lower_bound;
    };
    const auto push = [&](const Cell& cell) {
      heap[size++] = cell;
      std::push_heap(heap.begin(), heap.begin() + static_cast<std::ptrdiff_t>(size), shallower);
    };
    push(whole);
    while (size > 0) {
      const double distance = search_.closest.exact.distance;
      const double resolved =
          std::min(search_.prune_bound(), distance - (distance < 0.0 ? kDepthResolution : 0.0));
      const Cell cell = heap[0];
      if (cell.lower_bound >= resolved || search_.box_cells_left < 2 ||
          search_.deadline->passed()) {
        search_.prune(cell.lower_bound);  // the least of those that are left
        return;
      }
      std::pop_heap(heap.begin(), heap.begin() + static_cast<std::ptrdiff_t>(size), shallower);
      --size;
      Eigen::Index axis;
      cell.box.sizes().maxCoeff(&axis);
      const double middle = cell.box.center()[axis];
      for (const bool upper : {false, true}) {
        Eigen::AlignedBox3d half = cell.box;
        (upper ? half.min() : half.max())[axis] = middle;
        push(make_cell(half, id));
        --search_.box_cells_left;
      }
    }
  }

  const BoxObstacles& obstacles_;
  LinkQueryState& link_;
  LinkSearch& search_;
  BoxRefinement refinement_;
  TraversalStack<Entry, stack_capacity(kMaxBoxLevels, kBoxWidth)> stack_;
};

}  // namespace

void search_depth(const BoxObstacles& obstacles, LinkQueryState* link) {
  BoxDepthSearch search(obstacles, link);
  const BoxesInside& boxes = link->search.boxes_inside;
  if (link->context.solid().is_closed() && boxes.is_complete()) {
    search.run(boxes);
  } else {
    search.run();
  }
}

}  // namespace ist
