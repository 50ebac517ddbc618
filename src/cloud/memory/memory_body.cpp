#include "internal/cloud/memory_body.h"

#include <algorithm>
#include <limits>
#include <vector>

#include "cloud/memory/key_set.h"
#include "cloud/memory/voxel_map_access.h"
#include "internal/geometry/solid_queries.h"

namespace ist {
namespace {

// Whether a point is in a solid or within the skin about it.
bool is_on_body(const Solid& solid, const Eigen::Vector3d& p_L, double skin) {
  return distance_outside(solid, p_L, skin).distance <= skin || solid.is_inside(p_L);
}

// The voxels of one solid, each once: those about inner spheres without a look at the surface.
class SolidVoxels {
 public:
  SolidVoxels(const PosedSolid& solid, const Eigen::Isometry3d& X_MF, const VoxelScale& scale,
              double skin)
      : solid_(solid), X_ML_(X_MF * solid.X_FL), scale_(scale), skin_(skin) {}

  // Appends a sphere within each voxel.
  // @param box  extended by what may hold any
  void append(std::vector<Eigen::Vector4f>* spheres, Eigen::AlignedBox3d* box) {
    const double farthest = std::max(skin_, solid_.tree->interior_gap());
    const Eigen::Isometry3d X_LM = X_ML_.inverse();
    for (const bool is_certain : {true, false}) {
      for_each_sphere([&](const Eigen::Vector3d& p_L, double inner_radius, double cover_radius) {
        const Eigen::Vector3d center = X_ML_ * p_L;
        const double radius = is_certain ? inner_radius + skin_ : cover_radius + farthest;
        box->extend((center.array() - radius).matrix());
        box->extend((center.array() + radius).matrix());
        for_each_key_in_sphere(center, radius, scale_, [&](const VoxelKey& key) {
          if (!visited_.insert(key)) return;
          const Eigen::Vector3d p = scale_.middle(key);
          if (!is_certain && !is_on_body(*solid_.solid, X_LM * p, skin_)) return;
          const Eigen::Vector3f middle = p.cast<float>();
          const auto inside = static_cast<float>(0.25 * scale_.resolution());
          spheres->emplace_back(middle.x(), middle.y(), middle.z(), inside);
        });
      });
    }
  }

 private:
  template <typename Visit>
  void for_each_sphere(const Visit& visit) const {
    for (const SphereLeaf& leaf : solid_.tree->leaves()) {
      for (int k = 0; k < leaf.count; ++k) {
        visit(Eigen::Vector3d(leaf.x[k], leaf.y[k], leaf.z[k]),
              static_cast<double>(leaf.inner_radius[k]), static_cast<double>(leaf.cover_radius[k]));
      }
    }
  }

  const PosedSolid& solid_;
  const Eigen::Isometry3d X_ML_;
  const VoxelScale& scale_;
  const double skin_;
  KeySet visited_;
};

}  // namespace

Eigen::AlignedBox3d note_body(Span<const PosedSolid> robot, const Eigen::Isometry3d& X_MF,
                              double skin, double now, MemoryMap* body) {
  Eigen::AlignedBox3d box;
  std::vector<Eigen::Vector4f> spheres;
  const VoxelScale scale(body->config().resolution);
  for (const PosedSolid& solid : robot) {
    SolidVoxels(solid, X_MF, scale, skin).append(&spheres, &box);
  }
  body->note_free(spheres, now);
  return box;
}

}  // namespace ist
