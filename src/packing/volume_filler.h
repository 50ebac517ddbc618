#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "internal/geometry/triangle_bvh.h"
#include "ist_proximity/packing/packing.h"
#include "medial_sphere.h"
#include "sphere_search.h"

namespace ist {

/// Finds the largest sphere that fits into the space that a packing has not filled yet, again and
/// again: ProtoSphere (Weller 2013, section 5.2), whose prototypes climb to local maxima of the
/// clearance (the distance from a point to the nearest obstacle).
///
/// Branch and bound over an octree decides where prototypes start. Clearance has the Lipschitz
/// constant 1, so the clearance at a cell's centre plus the cell's circumradius is an upper bound
/// of the clearance in the cell. The sphere found has at least nine tenths of the largest radius.
/// The search ends for good when the packing has to stop, or at kMaxCells cells.
class VolumeFiller {
 public:
  /// Cells of the octree, at most: 0.3 GB. They run out where the mesh is millions of times as long
  /// as `min_radius`.
  static constexpr std::size_t kMaxCells = 4000000;

  /// All references must outlive this.
  /// @param finder      knows the spheres in `spheres` as taken
  /// @param spheres     the packing so far; the caller adds to it
  /// @param min_radius  [m] smaller spheres are not looked for
  VolumeFiller(const TriangleBvh& bvh, const MedialSphereFinder& finder,
               const SphereSearch& spheres, double min_radius);

  /// Returns the next sphere, which the caller must add to `spheres`; nothing when no sphere of
  /// radius `at_least` [m] fits.
  std::optional<MedialSphere> next(double at_least);

 private:
  struct Cell {
    Eigen::Vector3d center;
    double half;  ///< [m] half an edge
    /// [m] signed distance from the centre to the mesh and the hole obstacles; negative outside
    double mesh_clearance;
    double clearance;         ///< [m] of the centre: the same, and to the packing's spheres
    double upper_bound;       ///< [m] of the clearance in the cell
    std::uint32_t accounted;  ///< spheres that `clearance` and `upper_bound` account for
    bool has_climbed;         ///< a prototype has started from its centre
  };
  struct Prototype {
    MedialSphere sphere;
    std::uint32_t accounted;  ///< spheres that it is known to be clear of
    int refusals;             ///< how often it was refused because of a hole
  };
  struct UpperBoundLess {
    bool operator()(const Cell& a, const Cell& b) const { return a.upper_bound < b.upper_bound; }
  };
  struct RadiusLess {
    bool operator()(const Prototype& a, const Prototype& b) const {
      return a.sphere.radius < b.sphere.radius;
    }
  };

  void divide(const Eigen::Vector3d& center, double half, const Cell* parent);
  void add_cell(const Eigen::Vector3d& center, double half, const Cell* parent);
  void push(const Cell& cell);
  void push(const Prototype& prototype);
  Cell pop_cell();
  Prototype pop_prototype();
  bool tighten(Cell* cell) const;
  void refine_best_cell();
  void add_prototype(const Eigen::Vector3d& start, int refusals = 0);
  void revise_prototypes();
  std::optional<MedialSphere> take_prototype();
  bool is_stopped();
  std::uint32_t sphere_count() const { return static_cast<std::uint32_t>(spheres_.size()); }

  const TriangleBvh& bvh_;
  const MedialSphereFinder& finder_;
  const SphereSearch& spheres_;
  const double min_radius_;
  std::vector<Cell> cells_;            // max-heap by upper bound
  std::vector<Prototype> prototypes_;  // max-heap by radius
  int refusals_ = 0;
  bool stopped_ = false;
};

}  // namespace ist
