#pragma once

#include <ist_proximity/ProximityArray.h>
#include <ros/time.h>
#include <tf2/buffer_core.h>

#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/repulsion/repulsion.h"
#include "ist_proximity/repulsion/repulsion_filter.h"
#include "ros/input/cloud_source.h"
#include "ros/model/model_loader.h"
#include "ros/output/closing_speed.h"
#include "ros/output/joint_repulsion.h"
#include "ros/parameters/parameters.h"
#include "ros/poses/joint_pose_source.h"
#include "ros/poses/joint_state_listener.h"
#include "ros/poses/pose_source.h"
#include "ros/status/diagnostics.h"
#include "ros/status/status.h"

namespace ist {

using CloudSources = std::vector<std::unique_ptr<CloudSource>>;

/// From poses and clouds to one ProximityArray, again and again: all that belongs to one robot
/// model. It takes what is there and waits for nothing. One thread.
class ProximityCycle {
 public:
  enum class Reader { kOnly, kOther };

  /// @param model  ready
  /// @param poses  of model->robot->links; null: there is no kinematics to compute them
  /// @param reader kOnly: the one thread that reads the sources' channels; kOther: shares with it
  ProximityCycle(std::shared_ptr<const ModelState> model, const ServerConfig& config,
                 std::unique_ptr<PoseSource> poses, Reader reader);

  /// @param now      of the ROS clock
  /// @param message  overwritten
  /// @param report   its transform_problem is read; sources, poses and status are overwritten, the
  ///                 times go on
  void run(const ros::Time& now, const CloudSources& sources, const LiveConfig& config,
           ist_proximity::ProximityArray* message, CycleReport* report);

  /// After the clock has jumped: no speed across the jump, and the repulsion's filter starts anew.
  void forget();

  /// What the last run() has measured with; valid until the next one.
  SnapshotSpan clouds() const { return clouds_; }
  /// By link of the robot: whether the last run() could measure it, if it had a pose.
  std::vector<bool> measurable() const;

  /// The repulsion of the last run(), in the joints.
  /// @param proximity  what run() has filled in
  void fill_joint_repulsion(const ist_proximity::ProximityArray& proximity,
                            ist_proximity::JointRepulsion* message);

 private:
  void look_at_sources(const ros::Time& now, const CloudSources& sources);
  void look_at_poses(const ros::Time& now);
  std::vector<std::string> pose_problems() const;
  ClosingSpeed::Nearest nearest_source(const LinkProximity& result) const;
  void fill_links(const LiveConfig& config, ist_proximity::ProximityArray* message);
  Wrench penetration(std::size_t link, const LiveConfig& config) const;

  std::shared_ptr<const ModelState> model_;
  const RobotModel& robot_;
  std::string fixed_frame_;
  std::unique_ptr<PoseSource> pose_source_;
  const Reader reader_;
  const double pose_timeout_;  ///< [s]
  ProximityQuery query_;
  Repulsion repulsion_;
  std::vector<RepulsionFilter> filters_;  ///< by link of the robot
  std::vector<ClosingSpeed> speeds_;      ///< by link of the robot
  JointRepulsion joint_repulsion_;

  // Of this cycle.
  StampedLinkPoses poses_;
  Situation situation_;
  std::vector<const SourceSnapshot*> snapshots_;             ///< by source; null: none
  std::vector<std::shared_ptr<const SourceSnapshot>> held_;  ///< with Reader::kOther
  std::vector<const CloudSnapshot*> clouds_;                 ///< what the query sees
  std::vector<std::string> cloud_names_;                     ///< of `clouds_`
  std::vector<LinkProximity> results_;                       ///< by link of the robot
  std::vector<RepulsiveWrench> pushes_;                      ///< by link of the robot, filtered
};

/// Frame of all results.
std::string fixed_frame_of(const ModelState& model, const ServerConfig& config);

/// @param model   ready
/// @param buffer  outlives the result
/// @param joints  outlives the result; null: link poses come from the buffer
/// @param which   of the joint states
/// @returns null when the URDF's kinematics is needed and faulty
std::unique_ptr<PoseSource> make_pose_source(const ModelState& model, const ServerConfig& config,
                                             const tf2::BufferCore& buffer,
                                             JointStateListener* joints,
                                             JointPoseSource::Which which);

/// By link of model.robot: names, and whether its pose is asked for.
std::vector<std::string> link_names(const RobotModel& robot);
std::vector<bool> wanted_links(const ModelState& model);

/// What is said while there is no model to measure with: MODEL_ERROR and every link UNKNOWN.
/// @param fixed_frame  may be empty, while only the URDF could tell
void say_no_model(const ModelState& model, const std::string& fixed_frame, const ros::Time& now,
                  const CloudSources& sources, ist_proximity::ProximityArray* message,
                  CycleReport* report);

}  // namespace ist
