#include "ist_proximity/contact/contact_volume.h"

#include <limits>

namespace ist {
namespace {

// [m] A query that met no deadline knows whether points are inside, except for rounding.
constexpr double kRounding = 1e-4;

// Whether a deadline passed before the query knew whether the link is in contact.
bool is_undecided(const LinkProximity& proximity, const QueryConfig& config) {
  const double points_bound = proximity.lower_bound + proximity.sensor_width + config.margin;
  return proximity.state == LinkState::kNear && points_bound < -kRounding;
}

}  // namespace

Wrench Wrench::unknown() {
  const Eigen::Vector3d nan = Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  return {nan, nan};
}

Wrench& Wrench::operator+=(const Wrench& other) {
  force += other.force;
  torque += other.torque;
  return *this;
}

Wrench contact_wrench(const ContactVolume& contact, const Eigen::Isometry3d& X_FL,
                      const PenetrationConfig& config) {
  return {config.stiffness * (X_FL.linear() * contact.weighted_normal),
          config.stiffness * (X_FL.linear() * contact.weighted_moment)};
}

Wrench reaction(const Wrench& on_first, const Eigen::Vector3d& p_SecondFirst) {
  return {-on_first.force, -on_first.torque - p_SecondFirst.cross(on_first.force)};
}

Wrench penetration_wrench(const LinkProximity& proximity, const QueryConfig& query,
                          const ContactVolume* contact, const Eigen::Isometry3d& X_FL,
                          const PenetrationConfig& config) {
  if (proximity.state == LinkState::kUnknown || is_undecided(proximity, query)) {
    return Wrench::unknown();
  }
  if (proximity.state != LinkState::kContact) return Wrench::zero();
  if (contact == nullptr || contact->known < 1.0) return Wrench::unknown();
  return contact_wrench(*contact, X_FL, config);
}

}  // namespace ist
