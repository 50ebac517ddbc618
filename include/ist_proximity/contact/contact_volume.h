#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <vector>

#include "ist_proximity/cloud/cloud_snapshot.h"
#include "ist_proximity/contact/contact_model.h"
#include "ist_proximity/robot/robot_model.h"

namespace ist {

/// The volume that a link shares with something, and where it presses. In the frame and about the
/// point that each function states.
struct ContactVolume {
  double volume = 0.0;                             ///< [m^3] sum of all lenses V; >= 0
  Eigen::Vector3d push = Eigen::Vector3d::Zero();  ///< [m^3] sum of V n, the way the link should go
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();  ///< [m^4] sum of P x V n, P the lens's middle
  std::size_t spheres = 0;  ///< of the obstacle, that share volume with the link

  void add(const ContactVolume& other, double weight);
};

/// Radius of the sphere that a thinned point stands for, in edges of the thinning grid's cells:
/// half their diagonal, so that spheres of neighbouring cells leave no gap between them.
constexpr double kPointSphereRadius = 0.8660254037844386;
/// A point counts in full from this depth on, in radii of its sphere.
constexpr double kFullDepth = 0.5;

/// Volume shared by a link and the obstacles, as lenses of spheres (Weller 2013, section 5.4):
/// every sphere of the link's disjoint packing against a sphere about every point of the thinned
/// clouds.
///
/// **Nothing counts twice.** A link's spheres do not overlap, and each stands for its own cell of
/// the link (ContactBody). A point's sphere keeps the share
///   w = V / (sum of its lenses with all spheres of points, its own included)
/// of its volume V: where n spheres overlap, each counts about 1/n. Together they count no more
/// than their union has (the mean of 1/n over a sphere is at least one over the mean of n),
/// whichever of the sources they come from, and two points in one place count as one. The cloud is
/// thinned to a grid, so more points on the same surface change next to nothing. A surface counts
/// as a layer of both sides of it, about 1.3 cells thick; how far that is from an obstacle's true
/// volume is in doc/contact.md.
///
/// **Nothing counts from outside.** A point counts from where it enters a sphere of the link's
/// packing for distances (LinkModel::tree), in proportion to its depth in it up to kFullDepth of
/// its radius, then in full. So the volume is 0 for a link that nothing is inside of, it grows from
/// 0 at touch, and a point that is less deep than the packing's gap does not count yet.
///
/// Leaves of a map are divided into cells no larger than those of the thinning grid, or a
/// thousandth of the link's volume where that is larger, each a sphere of the cell's volume, whole.
/// Volume that a map and a cloud both hold counts for each.
///
/// **n is continuous.** It is not the line between the centres, which vanishes for concentric
/// spheres and cancels among many small ones, but the link's way in (the opposite of ContactBody's
/// way out) at the lens's middle; shorter than 1, and 0 where all ways out are equally long, as a
/// continuous field in a sphere must be somewhere. Volume, push and turn are continuous in the
/// motion of link and points, from touch to full containment, at concentric spheres too.
///
/// Allocates nothing, locks nothing, never throws. Thread safe. The work is bounded by the number
/// of cells that a link can hold.
/// @param X_FL    link frame -> fixed frame, rigid
/// @param clouds  as given to ProximityQuery::run
/// @returns in the link's frame, about its origin
ContactVolume contact_volume(const LinkModel& link, const ContactBody& body,
                             const Eigen::Isometry3d& X_FL, SnapshotSpan clouds);

/// Volume shared by two links, lens by lens; each sphere counts for the cell that it stands for. 0
/// where no two inner spheres overlap. n is the mean of the first's way in and the second's way
/// out.
/// @param X_AB  frame of the second -> frame of the first, rigid
/// @returns of the first link, in its frame, about its origin
ContactVolume contact_volume(const ContactBody& a, const ContactBody& b,
                             const Eigen::Isometry3d& X_AB);

}  // namespace ist
