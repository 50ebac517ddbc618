#include "ist_proximity/contact/contact_volume.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <type_traits>

#include "contact/contact_spheres.h"
#include "contact/inner_sphere_depth.h"
#include "contact/overlap_weight.h"
#include "contact/sphere_contact.h"
#include "internal/bvh/bounding_sphere.h"
#include "internal/bvh/box_node.h"
#include "internal/bvh/traversal_stack.h"
#include "internal/cloud/box_bvh.h"
#include "internal/cloud/point_bvh.h"
#include "internal/cloud/thinned_cloud.h"
#include "internal/proximity/deadline.h"

namespace ist {
namespace {

// A link's volume is at most this many cells, where leaves of a map fill it.
constexpr double kCellsPerLink = 1000.0;
// A leaf of a map is halved no more often: 2^42 cells along each axis.
constexpr int kMaxHalvings = 126;
// The share that is known where time ended the sum is less than 1, whatever rounding does.
constexpr double kNearlyAll = 0.999;
// Cells of a leaf between two looks at the clock; each is looked up in the link's tree.
constexpr std::uint32_t kCellsBetweenLooks = 8;

// A node or tile that is still to be visited, and its share of the index.
struct Entry {
  std::int32_t child;
  double share;
};

// The tiles of points or boxes of an entry, if it has no children that are nodes.
// @returns whether it is such an entry; visit(tile) was called for each tile then
template <typename Index, typename Buffer, typename Visit>
bool visit_leaf(const Index& index, std::int32_t child, Buffer* buffer, const Visit& visit) {
  if constexpr (std::is_same_v<Index, ThinnedCloud>) {
    if (!ThinnedCloud::is_leaf(index.nodes()[static_cast<std::size_t>(child)])) return false;
    for (const ThinnedTile& tile : index.tiles(child, buffer)) visit(tile);
  } else {
    if (child >= 0) return false;
    visit(index.tile(static_cast<std::size_t>(~child), buffer));
  }
  return true;
}

template <typename Index>
struct TileBuffer {
  typename Index::Tile tiles;
};
template <>
struct TileBuffer<ThinnedCloud> {
  ThinnedNode tiles;
};

// Calls visit(tile) for the tiles of thinned points or boxes whose bounding sphere `may_touch`, or
// that of their node, until the deadline.
// @returns the share of the index that was visited; the children that may touch divide their
//          parent's share
template <typename Index, typename MayTouch, typename Visit>
double visit_tiles(const Index& index, Deadline* deadline, const MayTouch& may_touch,
                   const Visit& visit) {
  if (index.empty()) return 1.0;
  TileBuffer<Index> buffer;
  TraversalStack<Entry, stack_capacity(kMaxBoxLevels, kBoxWidth)> stack;
  stack.push({index.root(), 1.0});
  double left = 1.0;
  while (!stack.empty()) {
    if (deadline->passed()) return std::min(1.0 - left, kNearlyAll);
    const Entry entry = stack.pop();
    if (visit_leaf(index, entry.child, &buffer.tiles, visit)) {
      if (deadline->has_passed()) return std::min(1.0 - left, kNearlyAll);
      left -= entry.share;
      continue;
    }
    const BoxNode& node = index.nodes()[static_cast<std::size_t>(entry.child)];
    std::array<std::int32_t, kBoxWidth> touching;
    std::size_t count = 0;
    for (int k = 0; k < node.count; ++k) {
      if (may_touch(bounding_sphere(node, k))) touching[count++] = node.child[k];
    }
    for (std::size_t k = 0; k < count; ++k) {
      stack.push({touching[k], entry.share / static_cast<double>(count)});
    }
    if (count == 0) left -= entry.share;
  }
  return 1.0;
}

// Sums the contact volume of one link with obstacles.
class LinkContact {
 public:
  LinkContact(const LinkModel& link, const ContactGeometry& geometry, TimePoint end)
      : link_(link), geometry_(geometry), deadline_(end) {}

  /// @returns the share of the cloud that is summed
  double add_points(const CloudSnapshot& cloud, const Eigen::Isometry3d& X_LF,
                    SnapshotSpan clouds) {
    const ThinnedCloud thinned = cloud.index.bvh().thinned();
    const Eigen::Isometry3d &X_FO = thinned.X_FO(), X_LO = X_LF * X_FO;
    const double radius = point_sphere_radius(cloud);
    return visit_tiles(
        thinned, &deadline_,
        [&](const BoundingSphere& box) { return may_enter(X_LO * box.center, box.radius); },
        [&](const PointTile& tile) {
          for (int k = 0; k < tile.count && !deadline_.passed(); ++k) {
            const Eigen::Vector3d p_O = tile.point(k);
            add(X_LO * p_O, radius, [&] { return overlap_weight(X_FO * p_O, radius, clouds); });
          }
        });
  }

  /// @returns the share of the map that is summed
  double add_boxes(const CloudSnapshot& cloud, const Eigen::Isometry3d& X_LF) {
    const BoxBvh& index = cloud.boxes->bvh();
    const Eigen::Isometry3d X_LO = X_LF * cloud.X_FM * Eigen::Translation3d(index.origin());
    const double cell = std::max(cloud.thinning, std::cbrt(geometry_.volume / kCellsPerLink));
    return visit_tiles(
        index, &deadline_,
        [&](const BoundingSphere& box) { return may_enter(X_LO * box.center, box.radius); },
        [&](const BoxTile& tile) {
          for (int k = 0; k < tile.count; ++k) add_cells(tile.box(k), cell, X_LO, kMaxHalvings);
        });
  }

  const ContactVolume& sum() const { return sum_; }

 private:
  bool may_enter(const Eigen::Vector3d& p_L, double radius) const {
    const double touch = link_.tree.radius() + radius;
    return (p_L - link_.tree.center()).squaredNorm() < touch * touch &&
           intersects(link_.tree, p_L, radius);
  }

  // Halves a leaf of a map across its longest edge, down to cells.
  void add_cells(const Eigen::AlignedBox3d& box, double cell, const Eigen::Isometry3d& X_LO,
                 int halvings) {
    if (deadline_.passed_now_and_then(kCellsBetweenLooks)) return;
    const Eigen::Vector3d center = X_LO * box.center();
    if (!may_enter(center, 0.5 * box.sizes().norm())) return;
    Eigen::Index axis;
    if (box.sizes().maxCoeff(&axis) > cell && halvings > 0) {
      Eigen::AlignedBox3d low = box, high = box;
      low.max()[axis] = high.min()[axis] = box.center()[axis];
      add_cells(high, cell, X_LO, halvings - 1);
      add_cells(low, cell, X_LO, halvings - 1);
      return;
    }
    const double radius = std::cbrt(box.volume() * 3.0 / (4.0 * M_PI));
    if (radius > 0.0) add(center, radius, [] { return 1.0; });
  }

  // A sphere of the obstacle; its weight is evaluated only where it counts.
  template <typename Weight>
  void add(const Eigen::Vector3d& p_L, double radius, const Weight& weight) {
    const double full = kFullDepth * radius;
    const double depth = std::min(depth_in_spheres(link_.tree, p_L, 0.0, full), full);
    if (!(depth > 0.0) || !geometry_.has_volume()) return;
    const ContactVolume one = sphere_contact(*geometry_.spheres, p_L, radius);
    if (one.volume > 0.0) sum_.add(one, depth / full * weight());
  }

  const LinkModel& link_;
  const ContactGeometry& geometry_;
  Deadline deadline_;
  ContactVolume sum_;
};

// A sphere of link B with its outward field, in the frame of link A.
FieldSphere field_sphere(const ContactLeaf& leaf, int k, const Eigen::Isometry3d& X_AB) {
  FieldSphere sphere;
  const Eigen::Vector3d center(leaf.x[k], leaf.y[k], leaf.z[k]);
  sphere.center = (X_AB * center).cast<float>();
  sphere.radius = leaf.radius[k];
  const Eigen::Matrix3f R = X_AB.linear().cast<float>();
  Eigen::Matrix3f gradient;
  for (int i = 0; i < 9; ++i) gradient(i / 3, i % 3) = leaf.gradient[i][k];
  sphere.outward = R * Eigen::Vector3f(leaf.outward[0][k], leaf.outward[1][k], leaf.outward[2][k]);
  sphere.gradient = R * gradient * R.transpose();
  return sphere;
}

// Lens by lens: exact where the spheres fill both links.
ContactVolume lens_volumes(const ContactSpheres& spheres_a, const ContactSpheres& spheres_b,
                           const Eigen::Isometry3d& X_AB, Deadline* deadline) {
  ContactVolume sum;
  TraversalStack<std::int32_t, stack_capacity(kMaxTreeLevels, kSphereWidth)> stack;
  stack.push(0);
  while (!stack.empty()) {
    if (deadline->passed()) {
      sum.known = 0.0;
      break;
    }
    const std::int32_t child = stack.pop();
    if (child < 0) {
      const ContactLeaf& leaf = spheres_b.leaves[static_cast<std::size_t>(~child)];
      for (int k = 0; k < kSphereWidth; ++k) {
        if (!(leaf.radius[k] > 0.0F)) continue;
        sum.add(sphere_contact(spheres_a, field_sphere(leaf, k, X_AB)),
                static_cast<double>(leaf.cell_ratio[k]));
      }
      continue;
    }
    const SphereNode& node = spheres_b.tree.nodes()[static_cast<std::size_t>(child)];
    for (int k = 0; k < node.count; ++k) {
      const Eigen::Vector3d center = X_AB * Eigen::Vector3d(node.x[k], node.y[k], node.z[k]);
      if (intersects(spheres_a.tree, center, static_cast<double>(node.radius[k]))) {
        stack.push(node.child[k]);
      }
    }
  }
  return sum;
}

// Whether the spheres have no voids between them: the link is a ball, or some that are apart.
bool is_filled(const ContactGeometry& geometry) {
  constexpr double kShare = 0.999;
  return geometry.packed_volume > kShare * geometry.volume;
}

}  // namespace

void ContactVolume::add(const ContactVolume& other, double weight) {
  volume += weight * other.volume;
  weighted_normal += weight * other.weighted_normal;
  weighted_moment += weight * other.weighted_moment;
  spheres += other.spheres;
}

ContactVolume contact_volume(const LinkModel& link, const ContactGeometry& geometry,
                             const Eigen::Isometry3d& X_FL, SnapshotSpan clouds, TimePoint end) {
  LinkContact contact(link, geometry, end);
  const Eigen::Isometry3d X_LF = X_FL.inverse();
  double known = 0.0, indices = 0.0;
  for (const CloudSnapshot* cloud : clouds) {
    if (!cloud->index.bvh().thinned().empty()) {
      known += contact.add_points(*cloud, X_LF, clouds);
      ++indices;
    }
    if (cloud->boxes == nullptr || cloud->boxes->empty()) continue;
    known += contact.add_boxes(*cloud, X_LF);
    ++indices;
  }
  ContactVolume sum = contact.sum();
  if (known < indices) sum.known = known / indices;
  return sum;
}

// The mean of what either link's elements have inside the other one.
ContactVolume contact_volume(const ContactGeometry& a, const ContactGeometry& b,
                             const Eigen::Isometry3d& X_AB, TimePoint end) {
  Deadline deadline(end);
  ContactVolume sum;
  if (!a.has_volume() || !b.has_volume()) return sum;
  const ContactSpheres &in_a = *a.spheres, &in_b = *b.spheres;
  if (is_filled(a) && is_filled(b)) return lens_volumes(in_a, in_b, X_AB, &deadline);
  const ContactVolume of_a =
      in_a.elements.inside(in_b.solid, in_b.elements.box(), X_AB.inverse(), &deadline);
  const ContactVolume of_b = in_b.elements.inside(in_a.solid, in_a.elements.box(), X_AB, &deadline);
  const Eigen::Vector3d force_b = X_AB.linear() * of_b.weighted_normal;
  const Eigen::Vector3d moment_b =
      X_AB.linear() * of_b.weighted_moment + X_AB.translation().cross(force_b);
  sum.volume = 0.5 * (of_a.volume + of_b.volume);
  sum.weighted_normal = 0.5 * (force_b - of_a.weighted_normal);
  sum.weighted_moment = 0.5 * (moment_b - of_a.weighted_moment);
  sum.spheres = of_b.spheres;
  sum.known = 0.5 * (of_a.known + of_b.known);
  return sum;
}

}  // namespace ist
