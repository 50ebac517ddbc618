#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "ist_proximity/contact/contact_volume.h"
#include "ist_proximity/proximity/proximity_query.h"

namespace ist {

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
/// @param contact  of the link, in its frame; read in CONTACT only. Null: it is not known, and the
///                 wrench is NaN in CONTACT
/// @returns in the fixed frame, the torque about the link's origin. Thread safe.
Wrench penetration_wrench(const LinkProximity& proximity, const QueryConfig& query,
                          const ContactVolume* contact, const Eigen::Isometry3d& X_FL,
                          const PenetrationConfig& config);

}  // namespace ist
