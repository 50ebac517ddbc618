#pragma once

#include <Eigen/Core>

#include "ist_proximity/contact/contact_model.h"
#include "ist_proximity/contact/contact_volume.h"
#include "ist_proximity/tree/inner_sphere_tree.h"

namespace ist {

/// A sphere against a body's tree: the sums of its lenses.
/// @param center  [m] in the body's frame
/// @param radius  [m] > 0
ContactVolume lens_sum(const ContactBody& body, const Eigen::Vector3d& center, double radius);

/// A sphere of another body, with that body's way out.
struct FieldSphere {
  Eigen::Vector3f center;  ///< [m] as all here in the first body's frame
  float radius;            ///< [m]
  Eigen::Vector3f out;
  Eigen::Matrix3f slope;  ///< [1/m]
};

/// As lens_sum, of a sphere that has its own way out: n is the mean of both.
ContactVolume lens_sum(const ContactBody& body, const FieldSphere& sphere);

/// The most by which p lies in an inner sphere [m], negative outside of all: the largest r - |p -
/// c|.
/// @param floor   what is less is not told from it
/// @param enough  the search ends when more than this is found
double depth_in_spheres(const InnerSphereTree& tree, const Eigen::Vector3d& p_L, double floor,
                        double enough);

/// Whether a sphere may reach into an inner sphere of the tree.
inline bool reaches(const InnerSphereTree& tree, const Eigen::Vector3d& center, double radius) {
  return depth_in_spheres(tree, center, -radius, -radius) > -radius;
}

}  // namespace ist
