#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <memory>
#include <vector>

#include "ist_proximity/contact/contact_volume.h"
#include "support/scene.h"

/// Contact volumes by brute force in double: all spheres of the link against all of the obstacle.
namespace ist::test {

/// A sphere of a contact geometry, taken out of its leaves.
struct OracleSphere {
  Eigen::Vector3d center;  ///< [m] link frame
  double radius, cell_ratio;
  Eigen::Vector3d outward;
  Eigen::Matrix3d gradient;

  /// The outward field at p, shortened where it is undecided.
  Eigen::Vector3d outward_at(const Eigen::Vector3d& p) const;
};

std::vector<OracleSphere> spheres_of(const ContactGeometry& body);

/// The lens's middle, from the extents of both spheres along the line of their centres.
Eigen::Vector3d oracle_lens_middle(const Eigen::Vector3d& a, double R, const Eigen::Vector3d& b,
                                   double r);

/// pi s^2 (...) / 12 d with the smaller sphere where the other one holds it, as the formula stands.
double oracle_lens(double R, double r, double d);

ContactVolume oracle_contact(const LinkModel& link, const ContactGeometry& body,
                             const Eigen::Isometry3d& X_FL, SnapshotSpan clouds);

/// The contact volume of two links: lenses of balls, or else the mean of both ways.
ContactVolume oracle_contact(const ContactGeometry& a, const ContactGeometry& b,
                             const Eigen::Isometry3d& X_AB);

/// Points as a sensor at the origin would deliver them, thinned.
CloudSnapshot thinned(const std::vector<Eigen::Vector3d>& points, double thinning = 0.01,
                      const Eigen::Vector3d& far = Eigen::Vector3d::Zero());

/// A link of one or more elements with its body.
struct ContactLink {
  explicit ContactLink(const LinkGeometry& link_geometry, int spheres = 200,
                       double max_error = 0.005);
  const LinkModel& link() const { return model->links[0]; }

  LinkGeometry geometry;
  std::shared_ptr<const RobotModel> model;
  std::shared_ptr<const ContactGeometry> body;
};

}  // namespace ist::test
