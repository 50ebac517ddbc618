#include "contact/contact_spheres.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <utility>

#include "contact/outward_field.h"
#include "contact/power_cells.h"
#include "internal/bvh/traversal_stack.h"
#include "internal/tree/sphere_lanes.h"

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

// A child of the tree, and the greatest cell ratio below it.
struct Candidate {
  std::int32_t child;
  float ratio;
};

// Fills the entries of a child and of all below it. @returns its greatest ratio
float find_greatest_ratios(std::int32_t child, ContactSpheres* spheres) {
  float greatest = 0.0F;
  if (child < 0) {
    const ContactLeaf& leaf = spheres->leaves[static_cast<std::size_t>(~child)];
    return *std::max_element(leaf.cell_ratio, leaf.cell_ratio + kSphereWidth);
  }
  const auto number = static_cast<std::size_t>(child);
  const SphereNode& node = spheres->tree.nodes()[number];
  for (int k = 0; k < node.count; ++k) {
    const float ratio = find_greatest_ratios(node.child[k], spheres);
    spheres->greatest_ratio[number][static_cast<std::size_t>(k)] = ratio;
    greatest = std::max(greatest, ratio);
  }
  return greatest;
}

// The most spheres that one of them overlaps, itself included.
double greatest_overlap(const std::vector<InnerSphere>& spheres) {
  constexpr double kTouch = 1e-6;
  std::ptrdiff_t most = 1;
  for (const InnerSphere& a : spheres) {
    most = std::max(most, std::count_if(spheres.begin(), spheres.end(), [&](const InnerSphere& b) {
                      const double reach = (1.0 - kTouch) * (a.radius + b.radius);
                      return (a.center - b.center).squaredNorm() < reach * reach;
                    }));
  }
  return static_cast<double>(most);
}

}  // namespace

double greatest_density(const ContactSpheres& spheres, const Eigen::Vector3d& center,
                        double radius) {
  constexpr float kRounding = 1.0F + 1e-4F;
  const Eigen::Vector3f c = center.cast<float>();
  const float r = kRounding * static_cast<float>(radius);
  const auto intersects = [&](const auto& node) {
    const SphereLanes x = SphereLaneMap(node.x) - c.x(), y = SphereLaneMap(node.y) - c.y(),
                      z = SphereLaneMap(node.z) - c.z();
    return ((x * x + y * y + z * z).sqrt() < SphereLaneMap(node.radius) + r).eval();
  };
  float greatest = 0.0F;
  TraversalStack<Candidate, stack_capacity(kMaxTreeLevels, kSphereWidth)> stack;
  if (!spheres.tree.empty()) stack.push({0, std::numeric_limits<float>::infinity()});
  while (!stack.empty()) {
    const Candidate candidate = stack.pop();
    if (!(candidate.ratio > greatest)) continue;
    if (candidate.child < 0) {
      const ContactLeaf& leaf = spheres.leaves[static_cast<std::size_t>(~candidate.child)];
      greatest = std::max(
          greatest,
          intersects(leaf).select(SphereLaneMap(leaf.cell_ratio), SphereLanes::Zero()).maxCoeff());
      continue;
    }
    const auto number = static_cast<std::size_t>(candidate.child);
    const SphereNode& node = spheres.tree.nodes()[number];
    const auto meeting = intersects(node);
    for (int k = 0; k < node.count; ++k) {
      const float ratio = spheres.greatest_ratio[number][static_cast<std::size_t>(k)];
      if (!meeting[k] || !(ratio > greatest)) continue;
      if (node.radius[k] < r) {
        greatest = ratio;
      } else {
        stack.push({node.child[k], ratio});
      }
    }
  }
  return spheres.overlap * static_cast<double>(greatest);
}

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
  spheres.greatest_ratio.resize(spheres.tree.nodes().size());
  find_greatest_ratios(0, &spheres);
  spheres.elements = VolumeElements(solid, field);
  spheres.solid = solid;
  spheres.overlap = std::min(greatest_overlap(tight.spheres), static_cast<double>(geometry.size()));
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
