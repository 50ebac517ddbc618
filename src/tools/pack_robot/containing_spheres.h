#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <string>
#include <vector>

#include "ist_proximity/geometry/shapes.h"
#include "ist_proximity/packing/packing.h"
#include "ist_proximity/robot/robot_model.h"

namespace ist::tools {

/// A sphere of a link, for programs that model robots by spheres.
struct LinkSphere {
  Eigen::Vector3d center;  ///< [m] link frame
  double radius = 0.0;     ///< [m]
};

/// Spheres that contain a link together, its surface and its inside: the cover spheres of its
/// packing, which contain the surface, larger by the gap that is left inside. A sphere that another
/// one contains is left out.
/// @param geometry  of the link, packed with `config`
std::vector<LinkSphere> containing_spheres(const LinkModel& link, const LinkGeometry& geometry,
                                           const PackingConfig& config);

/// The quality of a link's spheres, by the names and definitions of cuRobo's SphereFitMetrics.
/// Points are decided by the exact geometry, so that the error is that of the samples alone: 100 a
/// sphere, some 5,000 on the link's surface and in it.
struct SphereFit {
  std::string link;
  std::size_t num_spheres = 0;
  double coverage = 0.0;              ///< share of points inside the link that a sphere contains
  double protrusion = 0.0;            ///< share of points on the spheres that are outside the link
  double protrusion_dist_mean = 0.0;  ///< [m] mean distance of those points to the link
  double protrusion_dist_p95 = 0.0;   ///< [m] its 95th percentile
  double surface_gap_mean = 0.0;      ///< [m] mean distance of the link's surface to the spheres
  double surface_gap_p95 = 0.0;       ///< [m] its 95th percentile
  double max_uncovered_gap = 0.0;     ///< [m] its largest value
  double volume_ratio = 0.0;          ///< sum of the spheres' volumes by the volume of the link
};

/// @param geometry  of the link
SphereFit measure_fit(const LinkModel& link, const LinkGeometry& geometry,
                      const std::vector<LinkSphere>& spheres);

/// Prints the table to standard output, lengths in mm.
void print_fits(const std::vector<SphereFit>& fits);

}  // namespace ist::tools
