#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "internal/geometry/triangle_bvh.h"
#include "ist_proximity/packing/packing.h"
#include "medial_sphere.h"
#include "sphere_search.h"

namespace ist {

/// Finds the largest sphere that fits into what is left of a mesh, again and again: ProtoSphere
/// (Weller 2013, section 5.2), prototypes that climb to local maxima of the clearance.
///
/// Prototypes start where they can matter: in cells of an octree, the one with the largest possible
/// sphere first. Clearance changes by no more than the way moved, so the clearance at a cell's
/// centre bounds that in the cell, and the sphere found is the largest there is, to a tenth.
class VolumeFiller {
 public:
  /// @param finder  knows the spheres in `spheres` as taken
  /// @param min_radius  [m] smaller spheres are not looked for
  VolumeFiller(const TriangleBvh& bvh, const MedialSphereFinder& finder,
               const SphereSearch& spheres, double min_radius);

  /// Ends the search when `progress` returns false, which is asked every now and then.
  void stop_with(PackingProgress progress) { progress_ = std::move(progress); }

  /// The next sphere, which must be added to `spheres`; nothing when none of radius `at_least` [m]
  /// fits.
  std::optional<MedialSphereFinder::InnerSphere> next(double at_least);

 private:
  struct Cell {
    Eigen::Vector3d center;
    double half;         ///< [m] of an edge
    double room;         ///< [m] from the centre to the mesh and to holes, negative outside
    double clearance;    ///< [m] at the centre: the same, and to spheres
    double bound;        ///< [m] no sphere about a point of the cell is larger
    std::uint32_t seen;  ///< spheres that clearance and bound know of
    bool has_climbed;
  };
  struct Prototype {
    MedialSphereFinder::InnerSphere sphere;
    std::uint32_t seen;
    int refusals;  ///< how often a hole spoke against it
  };
  struct BoundLess {
    bool operator()(const Cell& a, const Cell& b) const { return a.bound < b.bound; }
  };
  struct Smaller {
    bool operator()(const Prototype& a, const Prototype& b) const {
      return a.sphere.radius < b.sphere.radius;
    }
  };

  void add_cell(const Eigen::Vector3d& center, double half, const Cell* parent);
  void add_prototype(const Eigen::Vector3d& start, int refusals = 0);
  void revise_prototypes();
  bool is_stopped();
  bool update(Cell* cell) const;
  std::uint32_t count() const { return static_cast<std::uint32_t>(spheres_.size()); }

  const TriangleBvh& bvh_;
  const MedialSphereFinder& finder_;
  const SphereSearch& spheres_;
  const double min_radius_;
  std::vector<Cell> cells_;            // heap
  std::vector<Prototype> prototypes_;  // heap
  PackingProgress progress_;
  std::uint32_t steps_ = 0;
  int refusals_ = 0;
  bool stopped_ = false;
};

}  // namespace ist
