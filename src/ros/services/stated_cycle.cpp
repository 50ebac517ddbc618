#include "ros/services/stated_cycle.h"

#include <algorithm>

#include "internal/geometry/limits.h"
#include "ist_proximity/robot/link_poses.h"

namespace ist {

std::string StatedCycle::take_model() {
  std::shared_ptr<const ModelState> model = node_.loader.state();
  if (!model->is_ready()) return model->problem;
  if (!model->kinematics) return no_kinematics(*model);
  if (model == model_) return "";
  const bool is_refined = cycle_ && model_ && is_refinement(*model_, *model);
  model_ = std::move(model);
  if (is_refined) {
    cycle_->refine(model_);
    return "";
  }
  auto poses = std::make_unique<StatedPoseSource>(
      model_->kinematics, node_.buffer, fixed_frame_of(*model_, node_.config),
      link_names(*model_->robot), node_.config.pose_timeout, node_.config.trajectory.tolerance,
      stamp_);
  poses_ = poses.get();
  cycle_ = std::make_unique<ProximityCycle>(
      model_, node_.config, std::move(poses), CloudSelection::Reader::kOther,
      make_cycles(node_.add_ons, *model_, CloudSelection::Reader::kOther));
  reach_ = kinematic_reach(*model_->robot, *model_->kinematics);
  impacts_ = std::make_unique<TimeOfImpact>(model_->robot, model_->kinematics, node_.config.query);
  return "";
}

std::string StatedCycle::run(const sensor_msgs::JointState& configuration, const LiveConfig& live,
                             ist_proximity::ProximityArray* result) {
  std::string problem = poses_->state(configuration);
  if (!problem.empty()) return problem;
  cycle_->forget();  // the configurations are no motion, so there is no speed between them
  cycle_->run(ros::Time::now(), node_.sources, live, "", result);
  return "";
}

TimeOfImpact& StatedCycle::impacts(const QueryConfig& query) {
  QueryConfig config = query;
  const double radius = std::min(reach_ + config.max_distance, kMaxLength);
  const double late = cycle_->late_obstacles(poses_->X_FR().translation(), radius);
  // They stand still from now on, and where they are now is not known better.
  config.margin += late;
  config.max_distance = std::max(config.max_distance - late, 0.5 * config.max_distance);
  impacts_->set_config(config);
  if (cycle_->has_worlds()) impacts_->set_surfaces(cycle_->world_answers().surfaces(), {});
  return *impacts_;
}

std::vector<bool> StatedCycle::measurable() const {
  // Nothing is known of the motion while the root link has no pose, or a mimic joint strays.
  if (!poses_->is_motion_known()) return std::vector<bool>(model_->robot->links.size(), false);
  return cycle_->measurable();
}

}  // namespace ist
