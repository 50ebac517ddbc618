#include "ist_proximity/contact/contact_volume.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "contact/kept_share.h"
#include "contact/lens_sum.h"
#include "internal/cloud/bounding_sphere.h"
#include "internal/cloud/box_bvh.h"
#include "internal/cloud/point_bvh.h"

namespace ist {
namespace {

// Cells that a link's volume is worth, at most, where leaves of a map fill it.
constexpr double kCellsPerLink = 1000.0;
// 16 children on each of the levels that 2^31 tiles can have; halves of a leaf.
constexpr std::size_t kStackSize = 160, kHalves = 128;

// Calls visit(tile) for the tiles of points or boxes whose sphere `may_touch`.
template <typename Index, typename MayTouch, typename Visit>
void visit_tiles(const Index& index, const MayTouch& may_touch, const Visit& visit) {
  if (index.empty()) return;
  typename Index::Tile room;
  std::array<std::int32_t, kStackSize> stack;
  std::size_t top = 0;
  stack[top++] = index.root();
  while (top > 0) {
    const std::int32_t child = stack[--top];
    if (child < 0) {
      visit(index.tile(static_cast<std::size_t>(~child), &room));
      continue;
    }
    const BoxNode& node = index.nodes()[static_cast<std::size_t>(child)];
    for (int k = 0; k < node.count; ++k) {
      if (may_touch(bounding_sphere(node, k))) stack[top++] = node.child[k];
    }
  }
}

// One link among the obstacles.
class LinkContact {
 public:
  LinkContact(const LinkModel& link, const ContactBody& body) : link_(link), body_(body) {}

  void points(const CloudSnapshot& cloud, const Eigen::Isometry3d& X_LF, SnapshotSpan clouds) {
    const Eigen::Isometry3d &X_FO = cloud.coarse.X_FO(), X_LO = X_LF * X_FO;
    const double radius = point_sphere_radius(cloud);
    visit_tiles(
        cloud.coarse.bvh(),
        [&](const BoundingSphere& box) { return may_enter(X_LO * box.center, box.radius); },
        [&](const PointTile& tile) {
          for (int k = 0; k < tile.count; ++k) {
            const Eigen::Vector3d p_O = tile.point(k);
            add(X_LO * p_O, radius, [&] { return kept_share(X_FO * p_O, radius, clouds); });
          }
        });
  }

  void boxes(const CloudSnapshot& cloud, const Eigen::Isometry3d& X_LF) {
    const BoxBvh& index = cloud.boxes->bvh();
    const Eigen::Isometry3d X_LO = X_LF * cloud.X_FM * Eigen::Translation3d(index.origin());
    const double cell = std::max(cloud.thinning, std::cbrt(body_.volume / kCellsPerLink));
    visit_tiles(
        index, [&](const BoundingSphere& box) { return may_enter(X_LO * box.center, box.radius); },
        [&](const BoxTile& tile) {
          for (int k = 0; k < tile.count; ++k) leaf(tile.box(k), cell, X_LO);
        });
  }

  const ContactVolume& sum() const { return sum_; }

 private:
  bool may_enter(const Eigen::Vector3d& p_L, double radius) const {
    const double reach = link_.tree.radius() + radius;
    return (p_L - link_.tree.center()).squaredNorm() < reach * reach &&
           reaches(link_.tree, p_L, radius);
  }

  // Halves a leaf of a map across its longest edge, down to cells.
  void leaf(const Eigen::AlignedBox3d& whole, double cell, const Eigen::Isometry3d& X_LO) {
    std::array<Eigen::AlignedBox3d, kHalves> stack;
    std::size_t top = 0;
    stack[top++] = whole;
    while (top > 0) {
      const Eigen::AlignedBox3d box = stack[--top];
      const Eigen::Vector3d center = X_LO * box.center();
      if (!may_enter(center, 0.5 * box.sizes().norm())) continue;
      Eigen::Index axis;
      if (box.sizes().maxCoeff(&axis) > cell && top + 2 <= kHalves) {
        Eigen::AlignedBox3d low = box, high = box;
        low.max()[axis] = high.min()[axis] = box.center()[axis];
        stack[top++] = low;
        stack[top++] = high;
        continue;
      }
      const double radius = std::cbrt(box.volume() * 3.0 / (4.0 * M_PI));
      if (radius > 0.0) add(center, radius, [] { return 1.0; });
    }
  }

  // A sphere of the obstacle; its share is asked for only where it counts.
  template <typename Share>
  void add(const Eigen::Vector3d& p_L, double radius, const Share& share) {
    const double full = kFullDepth * radius;
    const double depth = std::min(depth_in_spheres(link_.tree, p_L, 0.0, full), full);
    if (!(depth > 0.0)) return;
    const ContactVolume one = lens_sum(body_, p_L, radius);
    if (one.volume > 0.0) sum_.add(one, depth / full * share());
  }

  const LinkModel& link_;
  const ContactBody& body_;
  ContactVolume sum_;
};

FieldSphere field_sphere(const ContactLeaf& leaf, int k, const Eigen::Isometry3d& X_AB) {
  FieldSphere sphere;
  const Eigen::Vector3d center(leaf.x[k], leaf.y[k], leaf.z[k]);
  sphere.center = (X_AB * center).cast<float>();
  sphere.radius = leaf.radius[k];
  const Eigen::Matrix3f R = X_AB.linear().cast<float>();
  Eigen::Matrix3f slope;
  for (int i = 0; i < 9; ++i) slope(i / 3, i % 3) = leaf.slope[i][k];
  sphere.out = R * Eigen::Vector3f(leaf.out[0][k], leaf.out[1][k], leaf.out[2][k]);
  sphere.slope = R * slope * R.transpose();
  return sphere;
}

}  // namespace

void ContactVolume::add(const ContactVolume& other, double weight) {
  volume += weight * other.volume;
  push += weight * other.push;
  turn += weight * other.turn;
  spheres += other.spheres;
}

ContactVolume contact_volume(const LinkModel& link, const ContactBody& body,
                             const Eigen::Isometry3d& X_FL, SnapshotSpan clouds) {
  LinkContact contact(link, body);
  const Eigen::Isometry3d X_LF = X_FL.inverse();
  for (const CloudSnapshot* cloud : clouds) {
    contact.points(*cloud, X_LF, clouds);
    if (cloud->boxes != nullptr) contact.boxes(*cloud, X_LF);
  }
  return contact.sum();
}

ContactVolume contact_volume(const ContactBody& a, const ContactBody& b,
                             const Eigen::Isometry3d& X_AB) {
  ContactVolume sum;
  std::array<std::int32_t, kStackSize> stack;
  std::size_t top = 0;
  if (a.has_volume() && b.has_volume()) stack[top++] = 0;
  while (top > 0) {
    const std::int32_t child = stack[--top];
    if (child < 0) {
      const ContactLeaf& leaf = b.leaves[static_cast<std::size_t>(~child)];
      for (int k = 0; k < kSphereWidth; ++k) {
        if (!(leaf.radius[k] > 0.0F)) continue;
        sum.add(lens_sum(a, field_sphere(leaf, k, X_AB)), static_cast<double>(leaf.share[k]));
      }
      continue;
    }
    const SphereNode& node = b.tree.nodes()[static_cast<std::size_t>(child)];
    for (int k = 0; k < node.count; ++k) {
      const Eigen::Vector3d center = X_AB * Eigen::Vector3d(node.x[k], node.y[k], node.z[k]);
      if (reaches(a.tree, center, static_cast<double>(node.radius[k]))) {
        stack[top++] = node.child[k];
      }
    }
  }
  return sum;
}

}  // namespace ist
