#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

namespace ist {

/// The choice of a packing's spheres and their order.
enum class PackingOrder {
  /// Spheres near the medial axis that may overlap, where the gap is largest first. This takes the
  /// fewest spheres for a given error.
  kMedial,
  /// The same without overlap, so that no volume counts twice (contact volumes).
  kDisjoint,
  /// The largest sphere that still fits first, without overlap: the ProtoSphere packing (Weller
  /// 2013, chapter 5). It fills volume soonest and thin parts last.
  kVolume,
};

/// How a link is packed. The wanted error decides how many spheres it takes.
struct PackingConfig {
  /// [m] largest allowed distance from the link's surface to its inner spheres; > 0.
  double max_error = 0.005;
  /// Spheres per link, >= 1. A packing that reaches this number first is valid, with a larger
  /// error.
  int max_spheres = 20000;
  /// The choice of spheres and their order.
  PackingOrder order = PackingOrder::kMedial;
};

/// One sphere of a packing, with two radii about the same centre. The inner sphere lies inside the
/// link. The cover spheres of a packing together cover the link's surface.
struct InnerSphere {
  Eigen::Vector3d center;  ///< [m] in the link's frame
  /// [m] of the inner sphere. 0: a point of the surface that no inner sphere gets near to (sheets,
  /// flaps, some rims of holes). Negative: there is no inner sphere, the cover sphere covers some
  /// of the interior near a hole, and the surface is at that distance from the centre. Neither has
  /// a volume.
  double radius;
  double cover_radius;  ///< [m] >= 0 and >= radius; the difference is this sphere's gap
};

/// Upper bounds that are proven for every point of a link, not only for samples.
struct PackingCertificate {
  double max_gap = 0.0;       ///< [m] no surface point is farther from the inner spheres
  double mean_gap = 0.0;      ///< [m] area-weighted mean of the upper bounds of surface patches
  double interior_gap = 0.0;  ///< [m] no interior point is farther from the cover spheres
  double unreachable_area =
      0.0;                    ///< [m^2] surface near to spheres of radius 0 only (sheets, flaps)
  double surface_area = 0.0;  ///< [m^2]
  bool reached = false;       ///< max_gap <= max_error
};

/// Inner and cover spheres of one link or element.
///
/// For a point p let d_in(p) be the least |p - center| - radius of all spheres, d_cover(p) the same
/// with cover_radius, and d(p) the distance from p to the link's surface. For every p outside,
///
///     d_cover(p) <= d(p) <= d_in(p).
///
/// A point with d_cover(p) > interior_gap is certainly outside.
///
/// A point is outside where the mesh's generalized winding number is at most 0.5 (Jacobson et al.
/// 2013). The surface is the mesh's triangles and nothing in between: a point in a hole is as far
/// from the surface as from the hole's rim. The upper bound d_in is proven for meshes without
/// holes. With holes it is checked by a search in many directions about each sphere that may be
/// near one, and measured by the program pack_robot (protrusion).
struct Packing {
  /// In the order of insertion: every prefix is a coarser packing.
  std::vector<InnerSphere> spheres;
  /// The bounds of this packing.
  PackingCertificate certificate;
};

/// Called now and then from the thread that packs, with the share of the work done (0 to 1).
/// Returning false stops the packing early; what it returns then is valid, with a larger error.
using PackingProgress = std::function<bool(double)>;

}  // namespace ist
