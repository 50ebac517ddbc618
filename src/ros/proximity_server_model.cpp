// This part of ProximityServer hands the robot model to all others.

#include <ros/console.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "ros/common/text.h"
#include "ros/poses/joint_pose_source.h"
#include "ros/poses/transforms.h"
#include "ros/proximity_server_impl.h"

namespace ist {
namespace {

// Whether the robot's root stands still is asked this often where the URDF does not say it.
constexpr std::chrono::seconds kRootPeriod(1);

}  // namespace

/// Hands a new model to all parts.
void ProximityServer::Impl::take_model() {
  std::shared_ptr<const ModelState> model = loader_.state();
  if (model == model_) return;
  if (cycle_ && is_refinement(*model_, *model)) return refine_model(std::move(model));
  if (cycle_ && model->robot == model_->robot) {  // a message of its loading
    model_ = std::move(model);
    return cycle_->set_problem(*model_);
  }
  warm_up_.begin(nullptr);  // of the last model
  model_ = std::move(model);
  region_radius_ = 0.0;
  if (model_->robot) {
    cycle_ = std::make_unique<ProximityCycle>(
        model_, config_,
        make_pose_source(*model_, config_, buffer_, joint_states_.get(),
                         JointStateListener::Which::kTaken),
        CloudSelection::Reader::kOnly,
        make_cycles(add_ons_, *model_, CloudSelection::Reader::kOnly));
    cycle_->continue_from(last_stamp_);
  } else {
    cycle_.reset();
  }
  if (joint_states_) {
    buffer_.ignore(model_->kinematics ? computed_frames(*model_->kinematics)
                                      : std::vector<std::string>());
    joint_states_->set_kinematics(model_->kinematics);
  }
  set_source_targets(live_.get().query);
  root_stands_still_ = false;
  next_root_check_ = Clock::time_point();
  choose_counted_links();
}

/// Decides which links count in ~min_distance and ~speed_scale, and tells it where it is new.
void ProximityServer::Impl::choose_counted_links() {
  const CountedLinks before = std::move(counted_);
  counted_ = counted_links(*model_, config_, ignored_, root_stands_still_);
  const CountedLinks self =
      counted_links(*with_paired(model_), config_, ignored_, root_stands_still_);
  summary_.set_links(counted_, self);
  marker_drawer_.set_counts(counted_.counts);
  std::string problem = self.problem;
  if (model_->robot) {
    const std::vector<std::string> missing =
        SpeedScale(counted_.links).unknown_links(live_.get().speed_scale);
    if (!missing.empty() && config_.speed_scale_enabled) {
      problem += (problem.empty() ? "" : "; ") +
                 ("~speed_scale/links names '" + join(missing, "', '")) +
                 "', which is no monitored link: ~speed_scale stays 0";
    }
  }
  const std::lock_guard<std::mutex> lock(report_mutex_);
  if (!problem.empty() && problem != counted_problem_) ROS_WARN_STREAM(problem);
  if (!counted_.explanation.empty() && counted_.explanation != before.explanation) {
    ROS_INFO_STREAM(counted_.explanation);
  }
  counted_problem_ = problem;
  report_.counted_links = counted_.explanation;
}

/// A fixed frame outside of the URDF: the root stands still in it where tf says so for ever.
void ProximityServer::Impl::notice_standing_root() {
  if (!model_->robot || Clock::now() < next_root_check_) return;
  if (!has_frame_outside(*model_, config_)) return;
  next_root_check_ = Clock::now() + kRootPeriod;
  Eigen::Isometry3d ignored;
  ros::Time stamp;
  const bool stands = look_up(buffer_, fixed_frame_of(*model_, config_), model_->root_link,
                              ros::Time(), &ignored, &stamp)
                          .empty() &&
                      stamp.isZero();
  if (stands == root_stands_still_) return;
  root_stands_still_ = stands;
  choose_counted_links();
}

/// Links that ~ignore_links leaves out for a while.
void ProximityServer::Impl::notice_ignored_links(const ros::Time& now) {
  std::vector<std::string> names = ignore_service_.names(now);
  if (names == ignored_) return;
  ignored_ = std::move(names);
  choose_counted_links();
}

/// Hands finer packings of the same robot to all parts, which go on with what they know.
void ProximityServer::Impl::refine_model(std::shared_ptr<const ModelState> model) {
  model_ = std::move(model);
  cycle_->refine(model_);
  set_source_targets(live_.get().query);
}

/// [m] No obstacle of any source has a larger extent.
double ProximityServer::Impl::largest_extent() const {
  double largest = 0.0;
  for (const SourceConfig& source : config_.sources) {
    largest = std::max(largest, ist::largest_extent(source));
  }
  return largest;
}

/// Tells the sources the model, the fixed frame and the region of interest.
void ProximityServer::Impl::set_source_targets(const QueryConfig& query) {
  const std::string fixed_frame = fixed_frame_of(*model_, config_);
  margin_ = query.margin;
  RegionOfInterest region;
  // The region follows from the joint limits of the URDF, which poses from tf need not respect.
  const bool computes_poses = config_.pose_source == PoseSourceKind::kJointStates;
  if (computes_poses && model_->robot && model_->kinematics) {
    region = region_of_interest(*model_->robot, *model_->kinematics, fixed_frame,
                                query.max_distance + query.margin + largest_extent());
    // Clouds that were cropped before serve finer packings, too.
    region_radius_ = region.radius = std::max(region.radius, region_radius_);
  }
  for (const auto& source : inputs_)
    source->set_model(model_->robot, fixed_frame, region, model_->filters);
}

}  // namespace ist
