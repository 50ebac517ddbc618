#include "ist_proximity/robot/robot_region.h"

#include "internal/robot/reach.h"

namespace ist {
namespace {

constexpr double kRoom = 1e-3;  // [m] for what rounds, and for joints a little past their limits

}  // namespace

RegionOfInterest region_of_interest(const RobotModel& model, const Kinematics& kinematics,
                                    const std::string& fixed_frame, double beyond) {
  const auto frame = kinematics.find_link(fixed_frame);
  if (!frame) return {};
  Eigen::Isometry3d X_RF = Eigen::Isometry3d::Identity();
  for (std::size_t link = *frame; link > 0;) {
    const Kinematics::Joint& joint = kinematics.joints()[link - 1];
    if (joint.type != JointType::kFixed) return {};
    X_RF = joint.X_PJ * X_RF;
    link = joint.parent;
  }
  return {X_RF.inverse().translation(), reach(model, kinematics) + beyond + kRoom};
}

}  // namespace ist
