#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <vector>

#include "contact/outward_field.h"
#include "internal/proximity/deadline.h"
#include "ist_proximity/contact/contact_volume.h"
#include "ist_proximity/geometry/solid.h"

namespace ist {

/// A piece of a link's volume, in the link's frame.
struct VolumeElement {
  Eigen::Vector3f center;      ///< [m] of mass
  float volume;                ///< [m^3]
  Eigen::Matrix3f covariance;  ///< [m^2] of its points
  Eigen::Vector3f outward;     ///< the outward field at its centre, shortened where undecided
};

/// A link's volume as about four thousand elements: the cells of a grid, cut at the link's surface.
/// Immutable; const members are thread safe and allocate nothing.
class VolumeElements {
 public:
  VolumeElements() = default;
  VolumeElements(const Solid& solid, const OutwardField& field);

  /// The volume of this link that is inside another solid, and the sums of V o and p x V o. An
  /// element counts with the share that lies behind a plane at the solid's signed distance, as if
  /// its points were spread evenly along the plane's normal with the element's variance: flat faces
  /// that are parallel are exact at any depth. o is the outward field where half of an element or
  /// more is inside, and the opposite of the solid's normal where next to nothing of it is; in
  /// between their mean by the share, so that it is continuous.
  /// @param solid_box  about the solid, its frame S
  /// @param X_SL       this link's frame -> the solid's
  /// @param deadline   ends the sum
  /// @param rest       [m^3] receives what may be inside besides, at most: the volume of the
  ///                   elements near the solid that time left; about 0 where it left none
  /// @returns in this link's frame, about its origin
  ContactVolume inside(const Solid& solid, const Eigen::AlignedBox3d& solid_box,
                       const Eigen::Isometry3d& X_SL, Deadline* deadline, double* rest) const;

  const Eigen::AlignedBox3d& box() const { return box_; }  ///< about the link, its frame
  const std::vector<VolumeElement>& elements() const { return elements_; }

 private:
  static void add(const VolumeElement& element, const Solid* solid, const Eigen::Isometry3d& X_SL,
                  ContactVolume* sum);

  /// Elements that are next to one another.
  struct Block {
    Eigen::Vector3d center = Eigen::Vector3d::Zero();  ///< [m]
    double radius = 0.0;                               ///< [m] about all of its points
    double volume = 0.0;                               ///< [m^3] of its elements
    std::size_t first = 0, last = 0;
  };
  static bool is_near(const Block& block, const Eigen::AlignedBox3d& solid_box,
                      const Eigen::Isometry3d& X_SL) {
    return solid_box.exteriorDistance(Eigen::Vector3d(X_SL * block.center)) < block.radius;
  }
  double volume_near(std::size_t first, const Eigen::AlignedBox3d& solid_box,
                     const Eigen::Isometry3d& X_SL) const;
  static double depth_of(const Block& block, const Solid& solid,
                         const Eigen::AlignedBox3d& solid_box, const Eigen::Isometry3d& X_SL);

  Eigen::AlignedBox3d box_;
  std::vector<VolumeElement> elements_;
  std::vector<Block> blocks_;
};

}  // namespace ist
