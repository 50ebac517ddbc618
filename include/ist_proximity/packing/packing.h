#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <vector>

namespace ist {

/// Which spheres a packing takes, and in what order.
enum class PackingOrder {
  /// Medial spheres that may overlap, where the gap is largest first: the fewest for an error.
  kMedial,
  /// The same, of spheres that do not overlap: no volume counts twice (contact volumes).
  kDisjoint,
  /// The largest sphere that still fits first, none overlapping: the ProtoSphere packing of
  /// Weller 2013, chapter 5. Fills volume soonest and thin parts last.
  kVolume,
};

/// How a link is packed. The error that is wanted decides how many spheres it takes.
struct PackingConfig {
  /// [m] largest allowed distance from the link's surface to its packing; > 0.
  double max_error = 0.005;
  /// Spheres per link; reached first, the packing is still valid, with a larger error. >= 1.
  int max_spheres = 20000;
  PackingOrder order = PackingOrder::kMedial;
};

/// One sphere of a packing, twice: an inner sphere of `radius` inside the link, and an cover sphere
/// of `cover_radius` about the same centre. The cover spheres of a packing cover the link's
/// surface.
struct InnerSphere {
  Eigen::Vector3d center;  ///< [m] in the link's frame
  /// [m] of the inner sphere. 0: a point of the surface that no inner sphere reaches (sheets,
  /// flaps, some rims of holes). Negative: there is none, the cover sphere covers some of the
  /// inside by a hole, and the surface is that far from the centre. Neither has a volume.
  double radius;
  double cover_radius;  ///< [m] >= 0, >= radius; the difference is this sphere's gap
};

/// What is known for certain about a packing.
struct PackingCertificate {
  double max_gap = 0.0;       ///< [m] proven: no surface point is farther from the inner spheres
  double mean_gap = 0.0;      ///< [m] area-weighted mean of the per-patch bounds
  double interior_gap = 0.0;  ///< [m] proven: no interior point is farther from the cover spheres
  double unreachable_area = 0.0;  ///< [m^2] surface only spheres of radius 0 reach (sheets, flaps)
  double surface_area = 0.0;      ///< [m^2]
  bool reached = false;           ///< max_gap <= max_error
};

/// Inner and cover spheres of one link or element.
///
/// For every point p outside, with d_in(p) = min(|p - c| - radius) and d_out(p) likewise with
/// cover_radius: d_out(p) <= distance(p, surface). A point with d_out(p) > interior_gap is outside
/// for certain.
/// d_in(p) >= distance(p, surface). Outside is where the mesh's generalized winding number is at
/// most 0.5, and the surface is its triangles, nothing in between: before a hole, and in it up to
/// where the number is 0.5, a point is as far from the surface as from the hole's rim, and no inner
/// sphere comes nearer. Proven for meshes without holes; with holes it is looked for about each
/// sphere that may be near one, in many directions, and measured (PackingReport::protrusion).
struct Packing {
  std::vector<InnerSphere>
      spheres;  ///< in the order of insertion: every prefix is a coarser packing
  PackingCertificate certificate;
};

/// Called now and then from the packing thread with the share of the work done, 0 to 1.
/// Returning false stops the packing early.
using PackingProgress = std::function<bool(double)>;

}  // namespace ist
