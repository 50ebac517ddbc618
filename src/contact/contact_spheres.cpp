#include "contact/contact_spheres.h"

#include <algorithm>
#include <cstddef>
#include <limits>
#include <memory>
#include <utility>

#include "contact/outward_field.h"
#include "contact/power_cells.h"

namespace ist {
namespace {

// Smaller spheres than this share of the largest one hold next to nothing.
constexpr double kSmallest = 1e-3;

/// The spheres that have a volume, without their gaps, which would loosen the tree.
Packing solid_spheres(const Packing& packing) {
  double largest = 0.0;
  for (const InnerSphere& sphere : packing.spheres) largest = std::max(largest, sphere.radius);
  Packing tight;
  for (const InnerSphere& sphere : packing.spheres) {
    if (sphere.radius > kSmallest * largest) {
      tight.spheres.push_back({sphere.center, sphere.radius, sphere.radius});
    }
  }
  return tight;
}

/// Holds the surface, where the packing covers it.
Eigen::AlignedBox3d covered_box(const Packing& packing) {
  Eigen::AlignedBox3d box;
  for (const InnerSphere& sphere : packing.spheres) {
    box.extend(Eigen::Vector3d(sphere.center.array() - sphere.cover_radius));
    box.extend(Eigen::Vector3d(sphere.center.array() + sphere.cover_radius));
  }
  return box;
}

/// The sphere that a slot of the tree's leaves holds: the tree has an order of its own.
std::size_t find_sphere(const std::vector<InnerSphere>& spheres, const Eigen::Vector3f& center) {
  std::size_t best = 0;
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < spheres.size(); ++i) {
    const double squared = (spheres[i].center - center.cast<double>()).squaredNorm();
    if (squared >= nearest) continue;
    nearest = squared;
    best = i;
  }
  return best;
}

void set_outward_field(const OutwardField& field, const InnerSphere& sphere, int k,
                       ContactLeaf* leaf) {
  const Eigen::Vector3f outward = field.at(sphere.center).cast<float>();
  const Eigen::Matrix3f gradient = field.gradient(sphere.center, sphere.radius).cast<float>();
  for (int row = 0; row < 3; ++row) {
    leaf->outward[row][k] = outward[row];
    for (int column = 0; column < 3; ++column) {
      leaf->gradient[3 * row + column][k] = gradient(row, column);
    }
  }
}

ContactLeaf make_leaf(const SphereLeaf& source, const std::vector<InnerSphere>& spheres,
                      const PowerCells& cells, const OutwardField& field) {
  ContactLeaf leaf{};
  for (int k = 0; k < kSphereWidth; ++k) {
    leaf.x[k] = source.x[k];
    leaf.y[k] = source.y[k];
    leaf.z[k] = source.z[k];
    leaf.radius[k] = -1.0F;
    if (k >= source.count) continue;
    leaf.radius[k] = source.inner_radius[k];
    const std::size_t i = find_sphere(spheres, {source.x[k], source.y[k], source.z[k]});
    leaf.cell_ratio[k] = static_cast<float>(cells.ratio[i]);
    set_outward_field(field, spheres[i], k, &leaf);
  }
  return leaf;
}

}  // namespace

ContactGeometry make_contact_geometry(const LinkGeometry& geometry, const Solid& solid,
                                      const Packing& packing) {
  ContactGeometry result;
  const Packing tight = solid_spheres(packing);
  if (tight.spheres.empty()) {
    result.note = "has no volume (sheets): no penetration wrench";
    return result;
  }
  ContactSpheres spheres;
  spheres.tree = InnerSphereTree(tight);
  const PowerCells cells(tight.spheres, covered_box(packing), solid);
  const OutwardField field(geometry, solid);
  spheres.leaves.reserve(spheres.tree.leaves().size());
  for (const SphereLeaf& leaf : spheres.tree.leaves()) {
    spheres.leaves.push_back(make_leaf(leaf, tight.spheres, cells, field));
  }
  spheres.elements = VolumeElements(solid, field);
  spheres.solid = solid;
  result.spheres = std::make_shared<const ContactSpheres>(std::move(spheres));
  result.sphere_count = tight.spheres.size();
  result.volume = cells.volume;
  result.packed_volume = cells.packed_volume;
  return result;
}

Packing disjoint_part(const Packing& packing, std::size_t count) {
  std::vector<InnerSphere> spheres = packing.spheres;
  std::stable_sort(spheres.begin(), spheres.end(),
                   [](const InnerSphere& a, const InnerSphere& b) { return a.radius > b.radius; });
  Packing part;
  for (const InnerSphere& sphere : spheres) {
    if (part.spheres.size() == count || !(sphere.radius > 0.0)) break;
    const bool is_disjoint =
        std::all_of(part.spheres.begin(), part.spheres.end(), [&](const InnerSphere& other) {
          return (sphere.center - other.center).norm() >= sphere.radius + other.radius;
        });
    if (is_disjoint) part.spheres.push_back(sphere);
  }
  return part;
}

}  // namespace ist
