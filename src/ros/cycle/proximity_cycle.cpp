#include "ros/cycle/proximity_cycle.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "ros/common/ros_time.h"
#include "ros/cycle/cycle_message.h"
#include "ros/output/message_conversion.h"
#include "ros/status/pose_problems.h"

namespace ist {

using ist_proximity::ProximityArray;

ProximityCycle::ProximityCycle(std::shared_ptr<const ModelState> model, const ServerConfig& config,
                               std::unique_ptr<PoseSource> poses, CloudSelection::Reader reader)
    : model_(std::move(model)),
      packed_(model_->robot),
      robot_(*model_->robot),
      fixed_frame_(fixed_frame_of(*model_, config)),
      pose_source_(std::move(poses)),
      pose_timeout_(config.pose_timeout),
      selection_(reader),
      query_(model_->robot, config.query),
      repulsion_(model_->robot),
      filters_(robot_.links.size()),
      speeds_(robot_.links.size()),
      joint_repulsion_(*model_),
      results_(robot_.links.size()),
      pushes_(robot_.links.size(), RepulsiveWrench::unknown()) {
  status_input_.model_problem = model_->problem;
  for (const std::size_t i : model_->monitored) {
    const LinkModel& link = robot_.links[i];
    if (!link.usable()) status_input_.link_errors.push_back(link.error);
  }
}

void ProximityCycle::run(const ros::Time& now, const CloudSources& sources,
                         const LiveConfig& config, ProximityArray* message, CycleReport* report) {
  query_.set_config(config.query);
  look_up_poses(now);
  const auto begin = std::chrono::steady_clock::now();
  selection_.update(now, sources, model_->robot, poses_.stamp, pose_timeout_, &status_input_);
  describe_pose_problems(report->transform_problem);

  const SnapshotSpan clouds = selection_.clouds();
  std::vector<bool> known = measurable();
  for (std::size_t i = 0; i < known.size(); ++i) known[i] = known[i] && poses_.known[i];
  status_input_.deadline_passed =
      !query_.run(poses_.X_FL, known, clouds, &results_) && !clouds.empty();
  note_usage(config);
  status_input_.outside_region = query_.statistics().outside_region > 0;

  message->header.stamp = poses_.stamp;
  message->header.frame_id = fixed_frame_;
  message->cloud_stamp = selection_.oldest_stamp();
  fill_links(config, message);
  fill_status(status_input_, now, message, report);
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  message->computation_time = took.count();

  report->links_monitored = model_->monitored.size();
  report->links_known = poses_.count_known();
  report->pose_age = seconds_between(poses_.stamp, now);
  report->times.add(took.count());
  if (status_input_.deadline_passed) ++report->deadlines_missed;
}

std::vector<bool> ProximityCycle::measurable() const {
  std::vector<bool> measurable = wanted_links(*model_);
  selection_.exclude_unfiltered(&measurable);
  return measurable;
}

void ProximityCycle::look_up_poses(const ros::Time& now) {
  if (pose_source_) {
    pose_source_->look_up(now, &poses_);
  } else {
    poses_.reset(now, robot_.links.size());
    poses_.set_problem(wanted_links(*model_), {no_kinematics(*model_), false});
  }
  status_input_.clock_runs = !now.isZero();
}

void ProximityCycle::describe_pose_problems(const std::string& transform_problem) {
  std::vector<std::string>& problems = status_input_.pose_problems;
  problems = missing_poses(robot_, model_->monitored, poses_, pose_source_.get());
  for (std::size_t i = 0; i < selection_.selected().size(); ++i) {
    const SourceSnapshot* snapshot = selection_.selected()[i];
    if (!snapshot) continue;
    const std::string unfiltered = unfiltered_links(robot_, model_->monitored, poses_, *snapshot,
                                                    status_input_.sources[i].name);
    if (!unfiltered.empty()) problems.push_back(unfiltered);
  }
  status_input_.pose_doubts = poses_.doubts;
  const bool is_new = std::none_of(problems.begin(), problems.end(), [&](const std::string& text) {
    return text.find(transform_problem) != std::string::npos;
  });
  if (!problems.empty() && is_new) problems.push_back(transform_problem);
}

void ProximityCycle::fill_links(const LiveConfig& config, ProximityArray* message) {
  message->links.clear();
  const SnapshotSpan clouds = selection_.clouds();
  const std::uint64_t obstacles = obstacles_key(clouds);
  for (const std::size_t i : model_->monitored) {
    const LinkProximity& result = results_[i];
    const Eigen::Isometry3d& X_FL = poses_.X_FL[i];
    const ClosingSpeed::Nearest nearest = selection_.nearest(result);
    pushes_[i] = filters_[i].update(message->header.stamp.toSec(), obstacles,
                                    repulsion_.wrench(i, X_FL, clouds, result, config.repulsion),
                                    result, config.repulsion);
    message->links.push_back(to_message(
        robot_.links[i].name, result, pushes_[i], penetration(i, config),
        speeds_[i].update(message->header.stamp, result, X_FL, nearest), nearest.source));
  }
}

/// The wrench is unknown in contact until the link's contact body is packed.
Wrench ProximityCycle::penetration(std::size_t link, const LiveConfig& config) const {
  const LinkProximity& result = results_[link];
  const ContactGeometry* body = find_contact_geometry(config.contacts.get(), robot_, link);
  ContactVolume volume;
  const bool is_known = result.state == LinkState::kContact && body != nullptr;
  if (is_known) {
    volume = contact_volume(packed_->links[link], *body, poses_.X_FL[link], selection_.clouds());
  }
  return penetration_wrench(result, config.query, is_known ? &volume : nullptr, poses_.X_FL[link],
                            config.penetration);
}

/// Tells the background packing what the links need.
void ProximityCycle::note_usage(const LiveConfig& config) {
  if (!model_->usage) return;
  for (const std::size_t i : model_->monitored) {
    const bool is_near = results_[i].state >= LinkState::kNear &&
                         results_[i].lower_bound < config.repulsion.influence_distance;
    model_->usage->note_query(i, query_.link_statistics()[i], is_near);
  }
}

void ProximityCycle::refine(const std::shared_ptr<const ModelState>& model) {
  for (std::size_t i = 0; i < filters_.size(); ++i) {
    if (model->robot->links[i].packing_id != packed_->links[i].packing_id) {
      filters_[i].expect_jump();
    }
  }
  packed_ = model->robot;
  query_.set_model(packed_);
  repulsion_ = model->repulsion ? *model->repulsion : Repulsion(packed_);
}

void ProximityCycle::forget() {
  speeds_.assign(speeds_.size(), ClosingSpeed());
  filters_.assign(filters_.size(), RepulsionFilter());
  poses_.stamp = ros::Time();
}

void ProximityCycle::fill_joint_repulsion(const ProximityArray& proximity,
                                          ist_proximity::JointRepulsion* message) {
  joint_repulsion_.fill(pose_source_.get(), pushes_, proximity, message);
}

}  // namespace ist
