// The part of a link's query that measures against solid boxes.
//
// While a box is outside the link, its distance is exact: triangle against box, or primitive
// against box. A box that touches no triangle of a mesh is inside or outside as a whole; if the
// mesh has holes, the winding number at the box's middle decides. Where they overlap, the obstacle
// is every point of the box, and the answer is the depth of the deepest one found: its exact signed
// distance, so that the deepest of all is at least as deep. How much deeper it can be, branch and
// bound says: the signed distance at the middle of a part of the box bounds all of that part.

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "proximity/link_query.h"

namespace ist {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Parts of boxes that cannot be deeper than what is known by more than this are not divided. [m]
constexpr double kDepthResolution = 5e-4;

// Where box and surface meet, steps of these lengths inward decide whether they overlap. [m]
constexpr std::array<double, 3> kSteps = {1e-6, 1e-4, 1e-3};

// Enough to find out whether something touches. [m]
constexpr double kTouching = 1e-9;

Eigen::AlignedBox3d child_box(const BoxNode& node, int k) {
  return {Eigen::Vector3d(node.min_x[k], node.min_y[k], node.min_z[k]),
          Eigen::Vector3d(node.max_x[k], node.max_y[k], node.max_z[k])};
}

double radius_of(const Eigen::AlignedBox3d& box) { return 0.5 * box.sizes().norm(); }

}  // namespace

/// A part of a box, measured at its middle.
struct LinkQuery::BoxCell {
  Eigen::AlignedBox3d box;  ///< frame O
  double bound = 0.0;       ///< [m] none of its points has a smaller signed distance
};

// What touches is not decided yet: it goes on until a point inside is found, however wide the
// tolerance.
double LinkQuery::depth_threshold() const {
  return nearest_.exact.distance == 0.0 ? 0.0 : threshold();
}

void LinkQuery::consider_box(std::int32_t tile, int lane, bool is_outside) {
  const Eigen::AlignedBox3d box = boxes_->tiles()[static_cast<std::size_t>(tile)].box(lane);
  if (statistics_ != nullptr) ++statistics_->exact_evaluations;
  const double limit = std::min(nearest_.exact.distance, range() + rounding_);
  const BoxDistance found =
      distance_to_box(link_->solid, box, X_OL_, is_outside ? limit : kInfinity);
  if (found.distance > 0.0) {
    if (!is_outside) {  // as a whole it may be inside
      const Eigen::Vector3d middle = box.center();
      if (link_->tree.cover_distance(X_LO_ * middle, 0.0) <= link_->tree.interior_gap()) {
        take_point(middle, tile, lane);
      }
    }
    take_outside(found, tile, lane);
  } else {
    take_overlap(found, box, tile, lane);
  }
}

void LinkQuery::take_outside(const BoxDistance& found, std::int32_t tile, int lane) {
  if (found.lower_bound < std::min(found.distance, nearest_.exact.distance)) {
    drop(found.lower_bound);
  }
  if (!(found.distance < nearest_.exact.distance)) return;
  SignedDistance exact;
  exact.distance = found.distance;
  exact.witness = X_LO_ * found.p_OS;
  const Eigen::Vector3d p_L = X_LO_ * found.p_OB;
  exact.normal = (X_LO_.linear() * (found.p_OB - found.p_OS)) / found.distance;
  take(exact, p_L, found.p_OB, tile, lane);
}

void LinkQuery::take_point(const Eigen::Vector3d& p_O, std::int32_t tile, int lane) {
  if (statistics_ != nullptr) ++statistics_->exact_evaluations;
  const Eigen::Vector3d p_L = X_LO_ * p_O;
  take(link_->solid.signed_distance(p_L), p_L, p_O, tile, lane);
}

// They have a point in common, at least.
void LinkQuery::take_overlap(const BoxDistance& found, const Eigen::AlignedBox3d& box,
                             std::int32_t tile, int lane) {
  const Eigen::Vector3d p_L = X_LO_ * found.p_OB;
  SignedDistance touch = link_->solid.signed_distance(p_L);
  touch.distance = std::min(touch.distance, 0.0);  // what rounding has put outside touches
  if (touch.distance == 0.0) touch.witness = p_L;
  take(touch, p_L, found.p_OB, tile, lane);
  const Eigen::Vector3d into_link = X_OL_.linear() * -touch.normal;
  const Eigen::Vector3d into_box = (box.center() - found.p_OB).stableNormalized();
  for (const double step : kSteps) {
    take_point(clamp_to(box, found.p_OB + step * into_link), tile, lane);
    take_point(clamp_to(box, found.p_OB + step * (into_link + into_box)), tile, lane);
  }
}

// The spheres of a leaf and a box: the middle of a sphere, or what of the box is nearest to it, is
// where the depth is largest but for what the packing leaves open.
void LinkQuery::take_sphere(std::int32_t leaf, std::int32_t tile, int lane) {
  const SphereLeaf& spheres = link_->tree.leaves()[static_cast<std::size_t>(leaf)];
  const Eigen::AlignedBox3d box = boxes_->tiles()[static_cast<std::size_t>(tile)].box(lane);
  double deepest = kInfinity;
  Eigen::Vector3d p_O = box.center();
  for (int b = 0; b < spheres.count; ++b) {
    const Eigen::Vector3d center =
        X_OL_ * Eigen::Vector3d(spheres.x[b], spheres.y[b], spheres.z[b]);
    const Eigen::Vector3d nearest = clamp_to(box, center);
    const double distance =
        (center - nearest).norm() - static_cast<double>(spheres.inner_radius[b]);
    if (distance >= deepest) continue;
    deepest = distance;
    p_O = nearest;
  }
  take_point(p_O, tile, lane);
}

// As find_depth, of boxes: those that may hold points inside the link.
void LinkQuery::find_overlap(Deadline* deadline) {
  struct Entry {
    double distance;  // [m] of the node's middle from the link's cover spheres, less its radius
    std::int32_t child;
  };
  const double interior = link_->tree.interior_gap() + 3.0 * rounding_;
  std::array<Entry, 512> stack;  // 16 children on each of at most 8 levels, and room
  std::size_t top = 0;
  stack[top++] = {-kInfinity, boxes_->root()};
  while (top > 0) {
    const std::int32_t child = stack[--top].child;
    if (deadline->passed()) {
      drop(-link_->tree.radius());
      return;
    }
    if (child < 0) {
      find_overlap_in_tile(~child);
      continue;
    }
    const BoxNode& node = boxes_->nodes()[static_cast<std::size_t>(child)];
    const std::size_t begin = top;
    for (int k = 0; k < node.count; ++k) {
      const Eigen::AlignedBox3d box = child_box(node, k);
      const double near = interior + radius_of(box);
      const double distance = link_->tree.cover_distance(X_LO_ * box.center(), near);
      // Farther boxes hold no point inside; what they hold outside the descent has seen.
      if (distance > near) continue;
      std::size_t at = top++;
      for (; at > begin && stack[at - 1].distance < distance - near; --at)
        stack[at] = stack[at - 1];
      stack[at] = {distance - near, node.child[k]};
    }
  }
}

void LinkQuery::find_overlap_in_tile(std::int32_t tile) {
  const double interior = link_->tree.interior_gap() + 3.0 * rounding_;
  const BoxTile& boxes = boxes_->tiles()[static_cast<std::size_t>(tile)];
  for (int lane = 0; lane < boxes.count; ++lane) {
    if (deadline_->passed()) {
      drop(-link_->tree.radius());
      return;
    }
    const Eigen::AlignedBox3d box = boxes.box(lane);
    const Eigen::Vector3d middle_L = X_LO_ * box.center();
    const double near = interior + radius_of(box);
    const double outer = link_->tree.cover_distance(middle_L, interior);
    if (outer > near) continue;
    ++statistics_->exact_evaluations;
    const BoxDistance found =
        distance_to_box(link_->solid, box, X_OL_, std::max(nearest_.exact.distance, kTouching));
    if (found.distance > 0.0 && (outer > interior || !link_->solid.is_inside(middle_L))) {
      take_outside(found, tile, lane);
      continue;
    }
    const BoxCell whole = make_cell(box, tile, lane);
    if (whole.bound >= depth_threshold()) {
      drop(whole.bound);
      continue;
    }
    if (found.distance == 0.0) take_overlap(found, box, tile, lane);
    find_depth_in_box(whole, tile, lane);
  }
}

LinkQuery::BoxCell LinkQuery::make_cell(const Eigen::AlignedBox3d& box, std::int32_t tile,
                                        int lane) {
  const Eigen::Vector3d p_O = box.center(), p_L = X_LO_ * p_O;
  ++statistics_->exact_evaluations;
  const SignedDistance measured = link_->solid.signed_distance(p_L);
  take(measured, p_L, p_O, tile, lane);
  return {box, distance_floor(link_->solid, p_L, measured) - radius_of(box)};
}

// Best first: the part that may be deepest is halved across its longest edge, until no part can be
// deeper by more than the resolution, or the cells of this link are used up.
void LinkQuery::find_depth_in_box(const BoxCell& whole, std::int32_t tile, int lane) {
  std::array<BoxCell, kMaxCells + 2> heap;
  std::size_t size = 0;
  const auto shallower = [](const BoxCell& a, const BoxCell& b) { return a.bound > b.bound; };
  const auto push = [&](const BoxCell& cell) {
    heap[size++] = cell;
    std::push_heap(heap.begin(), heap.begin() + static_cast<std::ptrdiff_t>(size), shallower);
  };
  push(whole);
  while (size > 0) {
    const double resolved =
        std::min(depth_threshold(), nearest_.exact.distance -
                                        (nearest_.exact.distance < 0.0 ? kDepthResolution : 0.0));
    const BoxCell cell = heap[0];
    if (cell.bound >= resolved || cells_left_ < 2 || deadline_->passed()) {
      drop(cell.bound);  // the smallest of those that are left
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
      push(make_cell(half, tile, lane));
      --cells_left_;
    }
  }
}

}  // namespace ist
