#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>

#include "ist_proximity/cloud/cloud_snapshot.h"
#include "ist_proximity/contact/contact_model.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/robot/robot_model.h"

namespace ist {

/// The volume that a link shares with something, and where and along which normals: sums over
/// lenses of volume V, normal n and middle p. Each function states the frame, and the point that
/// the moment is about.
struct ContactVolume {
  double volume = 0.0;                                        ///< [m^3] sum of V; >= 0
  Eigen::Vector3d weighted_normal = Eigen::Vector3d::Zero();  ///< [m^3] sum of V n
  Eigen::Vector3d weighted_moment = Eigen::Vector3d::Zero();  ///< [m^4] sum of p x V n
  std::size_t spheres = 0;  ///< spheres of the obstacle that share volume with the link
  /// The share of the whole volume that `volume` is at least; 1: all is summed, and below 1 where
  /// time ended the sum. `volume` is a lower bound then, `volume / known` an upper one where known
  /// is above 0, and the rest says nothing. More time never makes it less. What is left is bounded
  /// by the volume of the spheres about the points in each box of the hierarchy that is not summed
  /// yet, or of the elements.
  double known = 1.0;

  /// Adds `weight` times the other's volume, normal and moment, and its number of spheres.
  /// @param other  in the same frame, about the same point
  void add(const ContactVolume& other, double weight);
};

/// Radius of the sphere about a thinned point, in edges of the thinning grid's cells: half their
/// diagonal, so that spheres of neighbouring cells leave no gap between them.
constexpr double kPointSphereRadius = 0.8660254037844386;
/// A point counts in full from this depth on, in radii of its sphere.
constexpr double kFullDepth = 0.5;

/// Volume shared by a link and the obstacles, as lenses of spheres (Weller 2013, section 5.4):
/// every sphere of the link's disjoint packing against a sphere about every point of the thinned
/// clouds. Pushing the link along n separates them.
///
/// **Nothing counts twice.** A link's spheres do not overlap, and each stands for its own power
/// cell (ContactGeometry). The sphere about a point has the overlap weight
///   w = V / (sum of its lenses with the spheres about all points, its own included)
/// for its volume V: where n spheres overlap, each counts about 1/n. Together they count no more
/// than their union has (the mean of 1/n over a sphere is at least one over the mean of n),
/// whichever of the sources they come from, and two points at one position count as one. The cloud
/// is thinned to a grid, so more points on the same surface change next to nothing. A surface
/// counts as a layer on both sides of it, about 1.3 cells thick; doc/accuracy.md says how far that
/// is from an obstacle's true volume.
///
/// **Nothing counts from outside.** A point counts from where it enters a sphere of the link's
/// packing for distances (LinkModel::tree), in proportion to its depth in it up to kFullDepth of
/// its radius, then in full. So the volume is 0 for a link that contains no point, it grows from
/// 0 at touch, and a point that is less deep than the packing's gap does not count yet.
///
/// Leaves of a map are divided into cells no larger than those of the thinning grid, or a
/// thousandth of the link's volume where that is larger. Each cell counts in full, as a sphere of
/// the cell's volume. Volume that a map and a cloud both hold counts for each.
///
/// **n is continuous.** It is not the line between the centres, which vanishes for concentric
/// spheres and cancels among many small ones, but the opposite of the link's outward field
/// (ContactGeometry) at the lens's middle; shorter than 1, and 0 where all sides are equally near,
/// as a continuous field in a sphere must be somewhere. All sums are continuous in the motion of
/// link and points, from touch to full containment, at concentric spheres too.
///
/// Allocates nothing, locks nothing, never throws. Thread safe. The work is bounded by the number
/// of cells that a link can hold, and by `end`.
/// @param X_FL    link frame -> fixed frame, rigid
/// @param clouds  as given to ProximityQuery::run
/// @param end     when the sum has to end; what is known by then says ContactVolume::known
/// @returns in the link's frame, about its origin
ContactVolume contact_volume(const LinkModel& link, const ContactGeometry& geometry,
                             const Eigen::Isometry3d& X_FL, SnapshotSpan clouds,
                             TimePoint end = TimePoint::max());

/// Volume shared by two links. Each link's volume is divided into about four thousand elements; the
/// share of each that is inside the other link's exact geometry counts, and the result is the mean
/// of both ways. Spheres would not do: near a face they leave most of the volume empty. Flat faces
/// that are parallel are exact at any depth; doc/accuracy.md has the errors of others. n is the
/// second link's outward field for its elements, and the opposite of the first's for its own; near
/// the other link's surface it is the normal of that. Of two balls the lens is taken.
///
/// Elements that the other link's surface cuts are cut by a plane. So the volume may be above 0
/// where links are apart by less than half an element, at edges and corners: ask SelfQuery whether
/// there is a contact. Allocates nothing, locks nothing. Thread safe. Measures some hundred exact
/// distances.
/// @param X_AB  frame of the second -> frame of the first, rigid
/// @param end   when the sum has to end; what is known by then says ContactVolume::known
/// @returns of the first link, in its frame, about its origin
ContactVolume contact_volume(const ContactGeometry& a, const ContactGeometry& b,
                             const Eigen::Isometry3d& X_AB, TimePoint end = TimePoint::max());

/// How strongly contact volumes push.
struct PenetrationConfig {
  /// [N/m^3] force per shared volume; >= 0. With the default a litre gives 100 N.
  double stiffness = 1e5;
};

/// Force and torque on a link.
struct Wrench {
  Eigen::Vector3d force;   ///< [N]
  Eigen::Vector3d torque;  ///< [N m]

  /// No force and no torque.
  static Wrench zero() { return {Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()}; }
  static Wrench unknown();  ///< NaN
  /// @param other  in the same frame, about the same point
  Wrench& operator+=(const Wrench& other);
};

/// A contact volume as a wrench: Weller 2013, section 5.4, force k sum(V n), torque k sum(p x V n).
/// @param contact  of the link, in its frame L, about its origin
/// @returns in the frame F, the torque about the link's origin
Wrench contact_wrench(const ContactVolume& contact, const Eigen::Isometry3d& X_FL,
                      const PenetrationConfig& config);

/// The opposite wrench, on the other link.
/// @param on_first   about the first link's origin
/// @param p_SecondFirst  [m] from the second link's origin to the first's, in the wrench's frame
/// @returns on the second link, about its origin
Wrench reaction(const Wrench& on_first, const Eigen::Vector3d& p_SecondFirst);

/// The wrench that pushes a link out of the obstacle.
///
/// Zero when CLEAR or NEAR; NaN when UNKNOWN, and when a deadline passed before it was known
/// whether the link is in contact. In CONTACT it is continuous from touch on, and still zero where
/// the deepest point is less deep than the gap of the link's packing there.
/// @param query    that the proximity was asked with
/// @param contact  of the link, in its frame; read in CONTACT only. Null, or not known entirely:
/// the
///                 wrench is NaN in CONTACT
/// @returns in the fixed frame, the torque about the link's origin. Thread safe.
Wrench penetration_wrench(const LinkProximity& proximity, const QueryConfig& query,
                          const ContactVolume* contact, const Eigen::Isometry3d& X_FL,
                          const PenetrationConfig& config);

}  // namespace ist
