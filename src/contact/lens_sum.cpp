#include "contact/lens_sum.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace ist {
namespace {

// Eight numbers side by side; Eigen turns them into SIMD, square roots included.
using Lanes = Eigen::Array<float, kSphereWidth, 1>;
using LaneMap = Eigen::Map<const Lanes, Eigen::Aligned16>;

constexpr std::size_t kStackSize = kSphereWidth * kMaxTreeLevels;
// Below this length a way out shortens towards 0 instead of turning: it has no direction any more.
constexpr float kUndecided = 0.2F;
constexpr float kTiny = 1e-12F;

struct Triple {
  Lanes x, y, z;
};

Lanes length(const Triple& v) { return (v.x * v.x + v.y * v.y + v.z * v.z).sqrt(); }

Triple shortened(const Triple& v) {
  const Lanes scale =
      (v.x * v.x + v.y * v.y + v.z * v.z + kUndecided * kUndecided).sqrt().inverse();
  return {v.x * scale, v.y * scale, v.z * scale};
}

// The lens between each of eight spheres and one.
struct Lenses {
  Lenses(const ContactLeaf& leaf, const Eigen::Vector3f& center, float radius)
      : to{center.x() - LaneMap(leaf.x), center.y() - LaneMap(leaf.y),
           center.z() - LaneMap(leaf.z)},
        distance(length(to)) {
    const LaneMap own(leaf.radius);
    const Lanes difference = own - radius;
    // See lens_volume.
    const Lanes apart = distance.max(difference.abs());
    const Lanes s = (own + radius - apart).max(0.0F);
    const Lanes q = difference / apart.max(kTiny);
    volume = LaneMap(leaf.share) * static_cast<float>(M_PI / 12.0) * s.square() *
             (apart + 2.0F * (own + radius) - 3.0F * difference * q);
    place = ((distance + difference) / (2.0F * distance).max(kTiny)).max(0.0F).min(1.0F);
  }
  Triple to;  // [m] from the spheres' centres to the other's
  Lanes distance, volume, place;
};

Triple way_out(const ContactLeaf& leaf, const Lenses& lenses) {
  const Lanes x = lenses.place * lenses.to.x, y = lenses.place * lenses.to.y,
              z = lenses.place * lenses.to.z;
  const auto component = [&](int row) {
    return Lanes(LaneMap(leaf.out[row]) + LaneMap(leaf.slope[3 * row]) * x +
                 LaneMap(leaf.slope[3 * row + 1]) * y + LaneMap(leaf.slope[3 * row + 2]) * z);
  };
  return shortened({component(0), component(1), component(2)});
}

// The other sphere's, at the lenses' middles, which lie on the way back from its centre.
Triple way_out(const FieldSphere& sphere, const Lenses& lenses) {
  const Lanes back = lenses.place - 1.0F;
  const Lanes x = back * lenses.to.x, y = back * lenses.to.y, z = back * lenses.to.z;
  const auto component = [&](int row) {
    return Lanes(sphere.out[row] + sphere.slope(row, 0) * x + sphere.slope(row, 1) * y +
                 sphere.slope(row, 2) * z);
  };
  return shortened({component(0), component(1), component(2)});
}

// Sums lane by lane.
struct Sum {
  Lanes volume = Lanes::Zero();
  Triple push = {Lanes::Zero(), Lanes::Zero(), Lanes::Zero()};
  Triple turn = push;

  void add(const ContactLeaf& leaf, const Lenses& lenses, const Triple& n) {
    volume += lenses.volume;
    const Triple f = {lenses.volume * n.x, lenses.volume * n.y, lenses.volume * n.z};
    push.x += f.x;
    push.y += f.y;
    push.z += f.z;
    const Lanes x = LaneMap(leaf.x) + lenses.place * lenses.to.x;
    const Lanes y = LaneMap(leaf.y) + lenses.place * lenses.to.y;
    const Lanes z = LaneMap(leaf.z) + lenses.place * lenses.to.z;
    turn.x += y * f.z - z * f.y;
    turn.y += z * f.x - x * f.z;
    turn.z += x * f.y - y * f.x;
  }

  static Eigen::Vector3d total(const Triple& v) {
    return Eigen::Vector3f(v.x.sum(), v.y.sum(), v.z.sum()).cast<double>();
  }
  ContactVolume total() const {
    const auto all = static_cast<double>(volume.sum());
    return {all, total(push), total(turn), all > 0.0 ? 1U : 0U};
  }
};

Lanes distances(const Eigen::Vector3f& p, const float* x, const float* y, const float* z) {
  return length({p.x() - LaneMap(x), p.y() - LaneMap(y), p.z() - LaneMap(z)});
}

// Calls visit(leaf) for the leaves that a sphere may touch.
template <typename Visit>
void visit_leaves(const InnerSphereTree& tree, const Eigen::Vector3f& center, float radius,
                  const Visit& visit) {
  std::array<std::int32_t, kStackSize> stack;
  std::size_t top = 0;
  if (!tree.empty()) stack[top++] = 0;
  while (top > 0) {
    const std::int32_t child = stack[--top];
    if (child < 0) {
      visit(static_cast<std::size_t>(~child));
      continue;
    }
    const SphereNode& node = tree.nodes()[static_cast<std::size_t>(child)];
    const Lanes gap = distances(center, node.x, node.y, node.z) - LaneMap(node.radius);
    for (int k = 0; k < node.count; ++k) {
      if (gap[k] < radius) stack[top++] = node.child[k];
    }
  }
}

}  // namespace

ContactVolume lens_sum(const ContactBody& body, const Eigen::Vector3d& center, double radius) {
  const Eigen::Vector3f c = center.cast<float>();
  const auto r = static_cast<float>(radius);
  Sum sum;
  visit_leaves(body.tree, c, r, [&](std::size_t index) {
    const ContactLeaf& leaf = body.leaves[index];
    const Lenses lenses(leaf, c, r);
    if (!(lenses.volume > 0.0F).any()) return;
    const Triple out = way_out(leaf, lenses);
    sum.add(leaf, lenses, {-out.x, -out.y, -out.z});
  });
  return sum.total();
}

ContactVolume lens_sum(const ContactBody& body, const FieldSphere& sphere) {
  Sum sum;
  visit_leaves(body.tree, sphere.center, sphere.radius, [&](std::size_t index) {
    const ContactLeaf& leaf = body.leaves[index];
    const Lenses lenses(leaf, sphere.center, sphere.radius);
    if (!(lenses.volume > 0.0F).any()) return;
    const Triple own = way_out(leaf, lenses), other = way_out(sphere, lenses);
    sum.add(leaf, lenses,
            {0.5F * (other.x - own.x), 0.5F * (other.y - own.y), 0.5F * (other.z - own.z)});
  });
  return sum.total();
}

double depth_in_spheres(const InnerSphereTree& tree, const Eigen::Vector3d& p_L, double floor,
                        double enough) {
  if (tree.empty()) return floor;
  struct Entry {
    std::int32_t child;
    float bound;  // [m] no sphere below is entered deeper
  };
  const Eigen::Vector3f p = p_L.cast<float>();
  auto deepest = static_cast<float>(floor);
  const auto stop = static_cast<float>(enough);
  std::array<Entry, kStackSize> stack;
  std::size_t top = 0;
  stack[top++] = {0, std::numeric_limits<float>::infinity()};
  while (top > 0) {
    const Entry entry = stack[--top];
    if (!(entry.bound > deepest)) continue;
    if (entry.child < 0) {
      const SphereLeaf& leaf = tree.leaves()[static_cast<std::size_t>(~entry.child)];
      const Lanes depth = LaneMap(leaf.inner_radius) - distances(p, leaf.x, leaf.y, leaf.z);
      deepest = std::max(deepest, depth.maxCoeff());
      if (deepest > stop) break;
      continue;
    }
    const SphereNode& node = tree.nodes()[static_cast<std::size_t>(entry.child)];
    const Lanes bound =
        (LaneMap(node.radius) - distances(p, node.x, node.y, node.z)).min(LaneMap(node.max_inner));
    const std::size_t begin = top;
    for (int k = 0; k < node.count; ++k) {
      if (!(bound[k] > deepest)) continue;
      std::size_t at = top++;  // the most promising child on top
      for (; at > begin && stack[at - 1].bound > bound[k]; --at) stack[at] = stack[at - 1];
      stack[at] = {node.child[k], bound[k]};
    }
  }
  return static_cast<double>(deepest);
}

}  // namespace ist
