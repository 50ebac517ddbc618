#include "ist_proximity/contact/contact_wrench.h"

#include <limits>

namespace ist {
namespace {

// [m] A complete query has decided whether points are inside, but for rounding.
constexpr double kDecided = 1e-4;

bool left_open(const LinkProximity& proximity, const QueryConfig& config) {
  return proximity.state == LinkState::kNear && proximity.lower_bound + config.margin < -kDecided;
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
  return {config.stiffness * (X_FL.linear() * contact.push),
          config.stiffness * (X_FL.linear() * contact.turn)};
}

Wrench reaction(const Wrench& on_first, const Eigen::Vector3d& p_SecondFirst) {
  return {-on_first.force, -on_first.torque - p_SecondFirst.cross(on_first.force)};
}

Wrench penetration_wrench(const LinkProximity& proximity, const QueryConfig& query,
                          const ContactVolume* contact, const Eigen::Isometry3d& X_FL,
                          const PenetrationConfig& config) {
  if (proximity.state == LinkState::kUnknown || left_open(proximity, query)) {
    return Wrench::unknown();
  }
  if (proximity.state != LinkState::kContact) return Wrench::zero();
  if (contact == nullptr) return Wrench::unknown();
  return contact_wrench(*contact, X_FL, config);
}

}  // namespace ist
