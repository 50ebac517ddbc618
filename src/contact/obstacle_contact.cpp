#include "contact/obstacle_contact.h"

#include <algorithm>

#include "contact/contact_spheres.h"
#include "contact/inner_sphere_depth.h"
#include "contact/overlap_weight.h"
#include "contact/sphere_contact.h"
#include "internal/bvh/bounding_sphere.h"
#include "internal/bvh/traversal_stack.h"
#include "internal/cloud/box_bvh.h"
#include "internal/cloud/point_bvh.h"
#include "internal/cloud/thinned_cloud.h"
#include "internal/geometry/numbers.h"

namespace ist {
namespace {

// A link's volume is at most this many cells, where leaves of a map fill it.
constexpr double kCellsPerLink = 1000.0;
// A leaf of a map is halved no more often: 2^42 cells along each axis.
constexpr int kMaxHalvings = 126;
// Cells of a leaf between two looks at the clock; each is looked up in the link's tree.
constexpr std::uint32_t kCellsBetweenLooks = 8;

Eigen::AlignedBox3d box_of(const BoxNode& node, int k) {
  return {Eigen::Vector3d(node.min_x[k], node.min_y[k], node.min_z[k]),
          Eigen::Vector3d(node.max_x[k], node.max_y[k], node.max_z[k])};
}

}  // namespace

ObstacleContact::ObstacleContact(const LinkModel& link, const ContactGeometry& geometry,
                                 const Eigen::Isometry3d& X_FL, SnapshotSpan clouds, TimePoint end)
    : link_(link), geometry_(geometry), X_LF_(X_FL.inverse()), clouds_(clouds), deadline_(end) {}

ContactVolume ObstacleContact::run() {
  add_roots();
  while (!frontier_.empty() && !deadline_.passed()) sum_entry(frontier_.pop());
  if (deadline_.has_passed()) {
    tighten();
    sum_.known = whole_.known_share(sum_.volume);
  }
  return sum_;
}

bool ObstacleContact::is_there(std::uint32_t index) const {
  const CloudSnapshot& source = cloud(index);
  if (!is_map(index)) return !source.index.bvh().thinned().empty();
  return source.boxes != nullptr && !source.boxes->empty();
}

const std::vector<BoxNode>& ObstacleContact::nodes(std::uint32_t index) const {
  const CloudSnapshot& source = cloud(index);
  return is_map(index) ? source.boxes->bvh().nodes() : source.index.bvh().nodes();
}

bool ObstacleContact::is_leaf(std::uint32_t index, std::int32_t child) const {
  if (is_map(index)) return child < 0;
  return ThinnedCloud::is_leaf(nodes(index)[static_cast<std::size_t>(child)]);
}

void ObstacleContact::enter(std::uint32_t index) {
  if (index == index_) return;
  index_ = index;
  const CloudSnapshot& source = cloud(index);
  if (is_map(index)) {
    X_LO_ = X_LF_ * source.X_FM * Eigen::Translation3d(source.boxes->bvh().origin());
    radius_ = std::max(source.thinning, std::cbrt(geometry_.volume / kCellsPerLink));
  } else {
    X_LO_ = X_LF_ * source.index.bvh().X_FO();
    radius_ = point_sphere_radius(source);
  }
  const Eigen::Vector3d center = X_LO_.inverse() * link_.tree.center();
  const Eigen::Vector3d reach = Eigen::Vector3d::Constant(link_.tree.radius());
  link_box_ = {Eigen::Vector3d(center - reach), Eigen::Vector3d(center + reach)};
}

// Nothing is known of the whole before each hierarchy has been entered.
void ObstacleContact::add_roots() {
  const auto count = static_cast<std::uint32_t>(2 * clouds_.size());
  for (std::uint32_t i = 0; i < count; ++i) unknown_ += is_there(i) ? 1 : 0;
  for (std::uint32_t i = 0; i < count; ++i) {
    if (!is_there(i)) continue;
    const auto root = static_cast<std::int32_t>(nodes(i).size()) - 1;
    const Entry entry{kInfinity, i, root};
    if (frontier_.has_room(1)) {
      frontier_.push(entry);
    } else {
      sum_subtree(entry);
      if (deadline_.has_passed()) return;
      --unknown_;
    }
  }
}

// Replaces an entry by its children, or by its sum.
void ObstacleContact::sum_entry(const Entry& entry) {
  const bool is_unknown = entry.bound == kInfinity;
  if (!is_unknown) rest_ -= entry.bound;
  current_ = is_unknown ? 0.0 : entry.bound;
  enter(entry.index);
  if (is_leaf(entry.index, entry.child)) {
    sum_leaf(entry);
  } else if (frontier_.has_room(kBoxWidth)) {
    visit_children(entry, [this](const Entry& child) {
      frontier_.push(child);
      if (child.bound == kInfinity) {
        ++unknown_;
      } else {
        rest_ += child.bound;
      }
    });
  } else {
    sum_subtree(entry);
  }
  if (deadline_.has_passed()) return;
  if (is_unknown) --unknown_;
  current_ = 0.0;
  tighten();
}

// Calls visit(child) for the children that may touch the link, with bounds no looser than their
// parent's.
template <typename Visit>
void ObstacleContact::visit_children(const Entry& entry, const Visit& visit) {
  const BoxNode& node = nodes(entry.index)[static_cast<std::size_t>(entry.child)];
  for (int k = 0; k < node.count; ++k) {
    const double bound = std::min(bound_of(node, k), entry.bound);
    if (bound > 0.0) visit(Entry{bound, entry.index, node.child[k]});
  }
}

// Depth first, for want of room.
void ObstacleContact::sum_subtree(const Entry& entry) {
  enter(entry.index);
  TraversalStack<Entry, stack_capacity(kMaxBoxLevels, kBoxWidth)> stack;
  stack.push(entry);
  while (!stack.empty() && !deadline_.passed()) {
    const Entry next = stack.pop();
    if (is_leaf(next.index, next.child)) {
      sum_leaf(next);
    } else {
      visit_children(next, [&](const Entry& child) { stack.push(child); });
    }
  }
}

void ObstacleContact::sum_leaf(const Entry& entry) {
  if (is_map(entry.index)) {
    sum_boxes(entry.child);
  } else {
    sum_points(entry.child);
  }
}

void ObstacleContact::sum_points(std::int32_t leaf) {
  const ThinnedCloud thinned = cloud(index_).index.bvh().thinned();
  const Eigen::Isometry3d& X_FO = thinned.X_FO();
  ThinnedNode buffer;
  for (const ThinnedTile& tile : thinned.tiles(leaf, &buffer)) {
    for (int k = 0; k < tile.count && !deadline_.passed(); ++k) {
      const Eigen::Vector3d p_O = tile.point(k);
      add(X_LO_ * p_O, radius_,
          [&] { return overlap_weight(X_FO * p_O, radius_, clouds_, &deadline_); });
    }
  }
}

void ObstacleContact::sum_boxes(std::int32_t child) {
  BoxTile buffer;
  const BoxTile& tile = cloud(index_).boxes->bvh().tile(static_cast<std::size_t>(~child), &buffer);
  for (int k = 0; k < tile.count; ++k) {
    const CellBound bound = bound_of_cells(tile.box(k));
    sum_cells(tile.box(k), bound, kMaxHalvings);
  }
}

// Halves a leaf of a map across its longest edge, down to cells.
void ObstacleContact::sum_cells(const Eigen::AlignedBox3d& box, const CellBound& bound,
                                int halvings) {
  if (deadline_.passed_now_and_then(kCellsBetweenLooks)) return;
  const Eigen::Vector3d center = X_LO_ * box.center();
  Eigen::Index axis;
  if (!may_enter(center, 0.5 * box.sizes().norm())) {
    current_ -= bound.of(box);
  } else if (box.sizes().maxCoeff(&axis) > radius_ && halvings > 0) {
    Eigen::AlignedBox3d low = box, high = box;
    low.max()[axis] = high.min()[axis] = box.center()[axis];
    sum_cells(high, bound, halvings - 1);
    sum_cells(low, bound, halvings - 1);
  } else {
    const double radius = std::cbrt(box.volume() * 3.0 / (4.0 * M_PI));
    if (radius > 0.0) add(center, radius, [] { return 1.0; });
    current_ -= bound.of(box);
  }
}

// A sphere of the obstacle; its weight is evaluated only where it counts. Without its weight it
// does not count.
template <typename Weight>
void ObstacleContact::add(const Eigen::Vector3d& p_L, double radius, const Weight& weight) {
  const double full = kFullDepth * radius;
  const double depth = std::min(depth_in_spheres(link_.tree, p_L, 0.0, full), full);
  if (!(depth > 0.0) || !geometry_.has_volume()) return;
  const ContactVolume one = sphere_contact(*geometry_.spheres, p_L, radius);
  if (!(one.volume > 0.0)) return;
  const double share = weight();
  if (share > 0.0) sum_.add(one, depth / full * share);
}

bool ObstacleContact::may_enter(const Eigen::Vector3d& p_L, double radius) const {
  const double touch = link_.tree.radius() + radius;
  return (p_L - link_.tree.center()).squaredNorm() < touch * touch &&
         intersects(link_.tree, p_L, radius);
}

double ObstacleContact::bound_of(const BoxNode& node, int k) const {
  const BoundingSphere sphere = bounding_sphere(node, k);
  if (!may_enter(X_LO_ * sphere.center, sphere.radius)) return 0.0;
  if (!geometry_.has_volume()) return 0.0;
  if (!is_map(index_)) return bound_of_points(box_of(node, k), node.child[k]);
  if (node.child[k] >= 0) return kInfinity;  // boxes may overlap, any number of them
  BoxTile buffer;
  const BoxTile& tile =
      cloud(index_).boxes->bvh().tile(static_cast<std::size_t>(~node.child[k]), &buffer);
  double sum = 0.0;
  for (int i = 0; i < tile.count; ++i) sum += bound_of_cells(tile.box(i)).of(tile.box(i));
  return sum;
}

// Weighted spheres of points have together no more volume than their union, which is within a
// radius of the points; and only points within the link count.
double ObstacleContact::bound_of_points(const Eigen::AlignedBox3d& box, std::int32_t child) const {
  const Eigen::AlignedBox3d counting = box.intersection(link_box_);
  if (counting.isEmpty()) return 0.0;
  const Eigen::Vector3d sizes = counting.sizes();
  const double density =
      greatest_density(*geometry_.spheres, X_LO_ * counting.center(), 0.5 * sizes.norm() + radius_);
  double volume = rounded_box_volume(sizes, radius_);
  if (is_leaf(index_, child)) {
    const int tiles = nodes(index_)[static_cast<std::size_t>(child)].count;
    const double one = 4.0 / 3.0 * M_PI * radius_ * radius_ * radius_;
    volume = std::min(volume, tiles * kPointWidth * one);
  }
  return density * volume;
}

// Only cells whose centre is within the link count, each with no more than its volume.
ObstacleContact::CellBound ObstacleContact::bound_of_cells(const Eigen::AlignedBox3d& box) const {
  // A cell that is halved as often as possible may still be longer.
  const double longest = std::max(radius_, std::ldexp(box.sizes().maxCoeff(), -kMaxHalvings / 3));
  const Eigen::Vector3d half = Eigen::Vector3d::Constant(0.5 * longest);
  CellBound bound{
      {Eigen::Vector3d(link_box_.min() - half), Eigen::Vector3d(link_box_.max() + half)}, 0.0};
  const Eigen::AlignedBox3d counting = box.intersection(bound.reach);
  if (counting.isEmpty()) return bound;
  // A cell's sphere has its volume, and may extend beyond its sides.
  bound.density = greatest_density(*geometry_.spheres, X_LO_ * counting.center(),
                                   0.5 * counting.sizes().norm() + longest);
  return bound;
}

void ObstacleContact::tighten() {
  if (unknown_ == 0) whole_.tighten(sum_.volume, rest_ + current_);
}

}  // namespace ist
