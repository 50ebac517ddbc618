#pragma once

#include <Eigen/Core>

#include "contact/contact_spheres.h"
#include "ist_proximity/contact/contact_volume.h"

namespace ist {

/// Contact volume of a link and one sphere of an obstacle: the sums over the lenses between the
/// link's spheres and that one. Here n is the opposite of the link's outward field.
/// @param center  [m] in the link's frame
/// @param radius  [m] > 0
ContactVolume sphere_contact(const ContactSpheres& link, const Eigen::Vector3d& center,
                             double radius);

/// A sphere of another link, with that link's outward field. All in the first link's frame.
struct FieldSphere {
  Eigen::Vector3f center;  ///< [m]
  float radius;            ///< [m]
  Eigen::Vector3f outward;
  Eigen::Matrix3f gradient;  ///< [1/m]
};

/// The same for a sphere of another link: n is the mean of its outward field and the opposite of
/// the first link's.
ContactVolume sphere_contact(const ContactSpheres& link, const FieldSphere& sphere);

}  // namespace ist
