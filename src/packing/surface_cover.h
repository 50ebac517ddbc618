#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "ist_proximity/geometry/shapes.h"
#include "ist_proximity/packing/packing.h"
#include "medial_sphere.h"
#include "packing_watch.h"
#include "sphere_search.h"
#include "surface_patch.h"
#include "volume_filler.h"

namespace ist {

/// Branch and bound over surface patches (triangles and their parts), each with the sphere that
/// covers it best and a certified upper bound of its gap. The patch with the largest bound comes
/// first: it is split where the bound is loose, and gets a sphere where it is not. The finder
/// decides which spheres are allowed.
class SurfaceCover {
 public:
  /// All arguments must outlive this.
  /// @param search  the packing's spheres, weighted by inner radius; the cover adds to it
  /// @param watch   when it stops, every search ends within milliseconds
  SurfaceCover(const TriangleMesh& mesh, const MedialSphereFinder& finder, SphereSearch* search,
               PackingWatch* watch);

  /// Adds spheres until every patch's bound is at most `config.max_error`, or until there are
  /// `config.max_spheres` or max_patches().
  /// @param filler  for disjoint packings, else null: a sphere that fills a large enough space
  ///                comes before the patch with the largest bound
  /// @returns false when it was stopped before every triangle had its sphere: then there is no
  ///          cover to certify
  bool refine(const PackingConfig& config, VolumeFiller* filler);

  /// Patches that a packing may have, which bounds its memory and time: those of the triangles, and
  /// some more for each sphere. An ordinary packing needs far fewer.
  static std::size_t max_patches(const TriangleMesh& mesh, const PackingConfig& config);

  /// Splits patches, without new spheres, until the largest upper bound is little above a gap that
  /// was found at a point of the surface.
  void tighten_certificate(const PackingConfig& config);

  /// Overwrites the packing's spheres, each with its gap from the patches that it covers best, and
  /// the surface part of its certificate.
  void certify(Packing* packing);

  const std::vector<MedialSphere>& spheres() const { return spheres_; }

 private:
  struct Patch : SurfacePatch {
    double upper_bound;       ///< [m] no point of the patch is farther from `sphere`
    std::uint32_t sphere;     ///< the one that covers it best
    std::uint32_t accounted;  ///< spheres that `upper_bound` accounts for
    std::uint32_t triangle;   ///< that it is a part of
  };
  struct Entry {
    double upper_bound;
    std::uint32_t patch;
  };
  struct UpperBoundLess {
    bool operator()(const Entry& a, const Entry& b) const { return a.upper_bound < b.upper_bound; }
  };

  void add_first_sphere(VolumeFiller* filler);
  bool cover_triangles();
  bool fill(double min_radius, VolumeFiller* filler);
  void add_sphere(const MedialSphere& sphere);
  double sampled_gap(const Patch& patch, Eigen::Vector3d* worst_point) const;
  std::uint32_t pop();
  void push(std::uint32_t index);
  bool tighten(Patch* patch) const;
  void split_or_add_sphere(std::uint32_t index, double max_error);
  void split(std::uint32_t index);
  template <class Search>
  MedialSphere admitted(const Eigen::Vector3d& s, const Search& search) const;
  MedialSphere candidate(const Eigen::Vector3d& s, std::uint32_t triangle, double gap) const;
  Eigen::Vector3d normal(std::uint32_t triangle) const;

  const TriangleMesh& mesh_;
  const MedialSphereFinder& finder_;
  std::vector<Patch> patches_;
  std::vector<Entry> heap_;  // max-heap of all patches but the one at work
  std::vector<MedialSphere> spheres_;
  SphereSearch& search_;
  PackingWatch& watch_;
  double min_edge_;  ///< [m] patches with shorter edges are not split: rounding would decide
};

}  // namespace ist
