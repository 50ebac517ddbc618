#include "ist_proximity/contact/contact_volume.h"

#include <cstdint>

#include "contact/contact_spheres.h"
#include "contact/inner_sphere_depth.h"
#include "contact/obstacle_contact.h"
#include "contact/sphere_contact.h"
#include "contact/volume_bound.h"
#include "internal/bvh/traversal_stack.h"
#include "internal/proximity/deadline.h"

namespace ist {
namespace {

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
// @param volume_b  [m^3] of all of B's spheres
ContactVolume lens_volumes(const ContactSpheres& spheres_a, const ContactSpheres& spheres_b,
                           const Eigen::Isometry3d& X_AB, double volume_b, Deadline* deadline) {
  ContactVolume sum;
  double rest = volume_b;
  TraversalStack<std::int32_t, stack_capacity(kMaxTreeLevels, kSphereWidth)> stack;
  stack.push(0);
  while (!stack.empty()) {
    if (deadline->passed()) {
      const double density =
          greatest_density(spheres_a, spheres_a.tree.center(), spheres_a.tree.radius());
      sum.known = known_share(sum.volume, density * rest);
      break;
    }
    const std::int32_t child = stack.pop();
    if (child < 0) {
      const ContactLeaf& leaf = spheres_b.leaves[static_cast<std::size_t>(~child)];
      for (int k = 0; k < kSphereWidth; ++k) {
        if (!(leaf.radius[k] > 0.0F)) continue;
        const auto ratio = static_cast<double>(leaf.cell_ratio[k]);
        const auto radius = static_cast<double>(leaf.radius[k]);
        sum.add(sphere_contact(spheres_a, field_sphere(leaf, k, X_AB)), ratio);
        rest -= ratio * 4.0 / 3.0 * M_PI * radius * radius * radius;
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
  return ObstacleContact(link, geometry, X_FL, clouds, end).run();
}

// The mean of what either link's elements have inside the other one.
ContactVolume contact_volume(const ContactGeometry& a, const ContactGeometry& b,
                             const Eigen::Isometry3d& X_AB, TimePoint end) {
  Deadline deadline(end);
  ContactVolume sum;
  if (!a.has_volume() || !b.has_volume()) return sum;
  const ContactSpheres &in_a = *a.spheres, &in_b = *b.spheres;
  if (is_filled(a) && is_filled(b)) return lens_volumes(in_a, in_b, X_AB, b.volume, &deadline);
  double rest_a = 0.0, rest_b = 0.0;
  const ContactVolume of_a =
      in_a.elements.inside(in_b.solid, in_b.elements.box(), X_AB.inverse(), &deadline, &rest_a);
  const ContactVolume of_b =
      in_b.elements.inside(in_a.solid, in_a.elements.box(), X_AB, &deadline, &rest_b);
  const Eigen::Vector3d force_b = X_AB.linear() * of_b.weighted_normal;
  const Eigen::Vector3d moment_b =
      X_AB.linear() * of_b.weighted_moment + X_AB.translation().cross(force_b);
  sum.volume = 0.5 * (of_a.volume + of_b.volume);
  sum.weighted_normal = 0.5 * (force_b - of_a.weighted_normal);
  sum.weighted_moment = 0.5 * (moment_b - of_a.weighted_moment);
  sum.spheres = of_b.spheres;
  if (deadline.has_passed()) sum.known = known_share(sum.volume, 0.5 * (rest_a + rest_b));
  return sum;
}

}  // namespace ist
