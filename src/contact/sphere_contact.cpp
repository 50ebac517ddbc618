#include "contact/sphere_contact.h"

#include <cmath>
#include <cstdint>

#include "contact/lens.h"
#include "internal/bvh/traversal_stack.h"
#include "internal/tree/sphere_lanes.h"

namespace ist {
namespace {

// An outward field shorter than this has no direction any more: it shortens to 0 and does not turn.
constexpr float kUndecidedLength = 0.2F;

struct Vectors {
  SphereLanes x, y, z;
};

SphereLanes length(const Vectors& v) { return (v.x * v.x + v.y * v.y + v.z * v.z).sqrt(); }

Vectors shortened(const Vectors& v) {
  const SphereLanes scale =
      (v.x * v.x + v.y * v.y + v.z * v.z + kUndecidedLength * kUndecidedLength).sqrt().inverse();
  return {v.x * scale, v.y * scale, v.z * scale};
}

// The lenses between eight spheres of a link and one sphere of the obstacle.
struct Lenses {
  Lenses(const ContactLeaf& leaf, const Eigen::Vector3f& center, float radius)
      : offset{center.x() - SphereLaneMap(leaf.x), center.y() - SphereLaneMap(leaf.y),
               center.z() - SphereLaneMap(leaf.z)} {
    const SphereLaneMap own(leaf.radius);
    const SphereLanes distance = length(offset), difference = own - radius;
    const Lens<SphereLanes> lens(own + radius, difference, distance);
    volume = SphereLaneMap(leaf.cell_ratio) * static_cast<float>(M_PI / 12.0) *
             lens.thickness.square() * lens.factor;
    middle = lens_middle(difference, distance);
  }
  Vectors offset;      // [m] from the link's spheres' centres to the obstacle's
  SphereLanes volume;  // [m^3] of the lens, times the cell ratio
  SphereLanes middle;  // where the lens's middle lies along `offset`, 0 to 1
};

// The link's outward field at the lenses' middles.
Vectors outward_field(const ContactLeaf& leaf, const Lenses& lenses) {
  const SphereLanes x = lenses.middle * lenses.offset.x, y = lenses.middle * lenses.offset.y,
                    z = lenses.middle * lenses.offset.z;
  const auto component = [&](int row) {
    return SphereLanes(SphereLaneMap(leaf.outward[row]) +
                       SphereLaneMap(leaf.gradient[3 * row]) * x +
                       SphereLaneMap(leaf.gradient[3 * row + 1]) * y +
                       SphereLaneMap(leaf.gradient[3 * row + 2]) * z);
  };
  return shortened({component(0), component(1), component(2)});
}

// The other link's outward field there; the offset from its centre has the opposite direction.
Vectors outward_field(const FieldSphere& sphere, const Lenses& lenses) {
  const SphereLanes back = lenses.middle - 1.0F;
  const SphereLanes x = back * lenses.offset.x, y = back * lenses.offset.y,
                    z = back * lenses.offset.z;
  const auto component = [&](int row) {
    return SphereLanes(sphere.outward[row] + sphere.gradient(row, 0) * x +
                       sphere.gradient(row, 1) * y + sphere.gradient(row, 2) * z);
  };
  return shortened({component(0), component(1), component(2)});
}

// Sums over lenses, lane by lane.
struct ContactSum {
  SphereLanes volume = SphereLanes::Zero();
  Vectors normal = {SphereLanes::Zero(), SphereLanes::Zero(), SphereLanes::Zero()};
  Vectors moment = normal;

  void add(const ContactLeaf& leaf, const Lenses& lenses, const Vectors& n) {
    volume += lenses.volume;
    const Vectors f = {lenses.volume * n.x, lenses.volume * n.y, lenses.volume * n.z};
    normal.x += f.x;
    normal.y += f.y;
    normal.z += f.z;
    const SphereLanes x = SphereLaneMap(leaf.x) + lenses.middle * lenses.offset.x;
    const SphereLanes y = SphereLaneMap(leaf.y) + lenses.middle * lenses.offset.y;
    const SphereLanes z = SphereLaneMap(leaf.z) + lenses.middle * lenses.offset.z;
    moment.x += y * f.z - z * f.y;
    moment.y += z * f.x - x * f.z;
    moment.z += x * f.y - y * f.x;
  }

  static Eigen::Vector3d total(const Vectors& v) {
    return Eigen::Vector3f(v.x.sum(), v.y.sum(), v.z.sum()).cast<double>();
  }
  ContactVolume total() const {
    const auto all = static_cast<double>(volume.sum());
    return {all, total(normal), total(moment), all > 0.0 ? 1U : 0U};
  }
};

// Calls visit(leaf, lenses) for the leaves that share volume with a sphere.
template <typename Visit>
void visit_lenses(const ContactSpheres& link, const Eigen::Vector3f& center, float radius,
                  const Visit& visit) {
  if (link.tree.empty()) return;
  TraversalStack<std::int32_t, stack_capacity(kMaxTreeLevels, kSphereWidth)> stack;
  stack.push(0);
  while (!stack.empty()) {
    const std::int32_t child = stack.pop();
    if (child < 0) {
      const ContactLeaf& leaf = link.leaves[static_cast<std::size_t>(~child)];
      const Lenses lenses(leaf, center, radius);
      if ((lenses.volume > 0.0F).any()) visit(leaf, lenses);
      continue;
    }
    const SphereNode& node = link.tree.nodes()[static_cast<std::size_t>(child)];
    const SphereLanes distance =
        length({center.x() - SphereLaneMap(node.x), center.y() - SphereLaneMap(node.y),
                center.z() - SphereLaneMap(node.z)}) -
        SphereLaneMap(node.radius);
    for (int k = 0; k < node.count; ++k) {
      if (distance[k] < radius) stack.push(node.child[k]);
    }
  }
}

}  // namespace

ContactVolume sphere_contact(const ContactSpheres& link, const Eigen::Vector3d& center,
                             double radius) {
  const Eigen::Vector3f c = center.cast<float>();
  const auto r = static_cast<float>(radius);
  ContactSum sum;
  visit_lenses(link, c, r, [&](const ContactLeaf& leaf, const Lenses& lenses) {
    const Vectors own = outward_field(leaf, lenses);
    sum.add(leaf, lenses, {-own.x, -own.y, -own.z});
  });
  return sum.total();
}

ContactVolume sphere_contact(const ContactSpheres& link, const FieldSphere& sphere) {
  ContactSum sum;
  visit_lenses(
      link, sphere.center, sphere.radius, [&](const ContactLeaf& leaf, const Lenses& lenses) {
        const Vectors own = outward_field(leaf, lenses);
        const Vectors other = outward_field(sphere, lenses);
        sum.add(leaf, lenses,
                {0.5F * (other.x - own.x), 0.5F * (other.y - own.y), 0.5F * (other.z - own.z)});
      });
  return sum.total();
}

}  // namespace ist
