#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "internal/geometry/cancelled.h"
#include "internal/geometry/openings.h"
#include "internal/geometry/surface_bvh.h"
#include "ist_proximity/robot/robot_model.h"
#include "proximity/coherence/displacement.h"

namespace ist {

/// The surface of a link for its distances to other links, in its frame L. Immutable.
struct LinkSurface {
  /// @throws Cancelled when the request says so
  explicit LinkSurface(const LinkModel& link, const CancelRequest& cancelled = {});

  /// The surface of a link; all that ask for one of the same solid share it while it is in use.
  /// The first one takes up to some tenths of a second. Thread safe.
  /// @throws Cancelled when the request says so
  static std::shared_ptr<const LinkSurface> of(const LinkModel& link,
                                               const CancelRequest& cancelled = {});

  Solid solid;
  SurfaceBvh surface;
  Openings openings;         ///< none for closed links
  SurfaceBvh opening_cells;  ///< over the cells of `openings`
  /// [m] No cell protrudes farther from the convex hull of the surface; inf: not known. The inside
  /// ends at the surface or in a cell, so it does not protrude farther either.
  double opening_margin = 0.0;
  /// One point of each connected component of the surface: where surfaces are apart, all of a
  /// component is inside another link, or nothing of it.
  std::vector<Eigen::Vector3d> component_points;
  /// [m] About everything that belongs to the link in contact and apart: its surface, what it
  /// encloses, and the openings of its holes.
  Eigen::AlignedBox3d box;
  DisplacementBound displacement;  ///< of that box
  /// [m] No point inside the link is farther from its surface.
  double depth_limit = 0.0;
};

}  // namespace ist
