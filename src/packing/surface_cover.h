#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "ist_proximity/geometry/shapes.h"
#include "ist_proximity/packing/packing.h"
#include "medial_sphere.h"
#include "sphere_search.h"
#include "volume_filler.h"

namespace ist {

/// The surface as patches, each with the sphere that covers it best and a proven bound of its gap.
/// Refines, worst first: a patch is split where the bound is loose and gets a sphere where it is
/// not. Which spheres are allowed is the finder's matter.
class SurfaceCover {
 public:
  /// @param search  the spheres there are, weighted by inner radius; the cover adds to it
  SurfaceCover(const TriangleMesh& mesh, const MedialSphereFinder& finder, SphereSearch* search);

  /// Adds spheres until every patch's bound is at most `config.max_error`, or max_spheres is
  /// reached.
  /// @param holes  where there is one, a large enough hole comes before the worst patch
  void refine(const PackingConfig& config, VolumeFiller* holes, const PackingProgress& progress);

  /// Splits patches, without new spheres, until the largest bound is little above a gap that is
  /// there for certain.
  void sharpen();

  /// Gives every sphere its gap, from the patches it covers best, and fills the certificate.
  void certify(Packing* packing);

  const std::vector<MedialSphereFinder::InnerSphere>& spheres() const { return spheres_; }

 private:
  struct Patch {
    Eigen::Vector3d corner[3];
    double bound;  ///< [m] no point of the patch is farther from `sphere`
    std::uint32_t sphere;
    std::uint32_t seen;  ///< spheres there were when it was last searched
    std::uint32_t triangle;
  };
  struct Entry {
    double bound;  ///< [m] of the patch
    std::uint32_t patch;
  };
  struct Looser {
    bool operator()(const Entry& a, const Entry& b) const { return a.bound < b.bound; }
  };

  void seed(VolumeFiller* holes);
  void cover_triangles();
  bool fill_hole(double at_least, VolumeFiller* holes);
  void add_sphere(const MedialSphereFinder::InnerSphere& sphere);
  double gap_at_points(const Patch& patch, Eigen::Vector3d* worst_point) const;
  static double longest_edge(const Patch& patch);
  std::uint32_t pop();
  void push(std::uint32_t index);
  bool tighten(Patch* patch) const;
  void split_or_fill(std::uint32_t index, double target);
  void split(std::uint32_t index);
  MedialSphereFinder::InnerSphere sphere_at(const Eigen::Vector3d& s, std::uint32_t triangle,
                                            double gap) const;
  template <class Search>
  MedialSphereFinder::InnerSphere admitted(const Eigen::Vector3d& s, const Search& search) const;
  MedialSphereFinder::InnerSphere candidate(const Eigen::Vector3d& s, std::uint32_t triangle,
                                            double gap) const;
  Eigen::Vector3d normal(std::uint32_t triangle) const;

  const TriangleMesh& mesh_;
  const MedialSphereFinder& finder_;
  std::vector<Patch> patches_;
  std::vector<Entry> heap_;  // of all patches but one that is worked on
  std::vector<MedialSphereFinder::InnerSphere> spheres_;
  SphereSearch& search_;
  double smallest_patch_;  ///< [m] edges below it are not split: rounding would decide
};

}  // namespace ist
