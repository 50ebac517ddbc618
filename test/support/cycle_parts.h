#pragma once

#include <ros/time.h>

#include <array>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "ist_proximity/robot/kinematics.h"
#include "ist_proximity/robot/link_poses.h"
#include "ros/input/source.h"
#include "ros/model/model_state.h"
#include "ros/poses/pose_source.h"

/// What a ProximityCycle needs, without a ROS master: a source of clouds and one of poses.
namespace ist::test {

/// A sensor whose newest cloud is what it is told.
class StatedSource : public ObstacleSource {
 public:
  explicit StatedSource(const std::string& name) {
    report_.name = name;
    report_.messages = 1;
  }

  void set_model(std::shared_ptr<const RobotModel> model, const std::string& fixed_frame,
                 const RegionOfInterest& region) {
    snapshot_->model = std::move(model);
    snapshot_->fixed_frame = fixed_frame;
    snapshot_->cloud.region = region;
  }
  const SourceSnapshot* newest(const SnapshotRequest& /*request*/) override {
    return snapshot_.get();
  }
  std::shared_ptr<const SourceSnapshot> share(const SnapshotRequest& /*request*/) override {
    return snapshot_;
  }
  void report(SourceReport* report) override {
    *report = report_;
    report->newest = snapshot_->stamp.toSec();
  }

  /// The cloud to fill next, of this stamp.
  CloudSnapshot* cloud(const ros::Time& stamp) {
    snapshot_->stamp = snapshot_->counts_from = stamp;
    return &snapshot_->cloud;
  }
  void set_timeout(double timeout) { report_.timeout = timeout; }
  /// The cloud's frame is late.
  void set_lag(const Lag& lag) { snapshot_->lags = {{lag, Lag()}}; }
  void set_lags(const std::array<Lag, 2>& lags) { snapshot_->lags = {lags}; }

 private:
  SourceReport report_;
  std::shared_ptr<SourceSnapshot> snapshot_ = std::make_shared<SourceSnapshot>();
};

/// The poses of links that it is told.
class StatedPoses : public PoseSource {
 public:
  void set(const std::vector<Eigen::Isometry3d>& X_FL) { X_FL_ = X_FL; }

  void look_up(const ros::Time& now, StampedLinkPoses* poses) override {
    poses->reset(now, X_FL_.size());
    poses->X_FL = X_FL_;
    poses->known.assign(X_FL_.size(), true);
  }
  void look_up_all(const Kinematics& /*kinematics*/, const ros::Time& /*instant*/,
                   BodyPoses* bodies) override {
    *bodies = BodyPoses();
  }
  std::string hint() const override { return ""; }

 private:
  std::vector<Eigen::Isometry3d> X_FL_;
};

/// A model that is ready, with every link monitored and no kinematics.
inline std::shared_ptr<const ModelState> ready_model(std::shared_ptr<const RobotModel> robot) {
  auto state = std::make_shared<ModelState>();
  state->phase = ModelState::Phase::kReady;
  state->robot = std::move(robot);
  state->root_link = "base";
  for (const LinkModel& link : state->robot->links) {
    state->monitored.push_back(state->links.size());
    state->links.push_back(link.name);
  }
  return state;
}

}  // namespace ist::test
