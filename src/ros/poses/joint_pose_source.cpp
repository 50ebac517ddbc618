#include "ros/poses/joint_pose_source.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "ros/common/ros_time.h"
#include "ros/common/text.h"
#include "ros/poses/joint_lag.h"
#include "ros/poses/tf_pose_source.h"
#include "ros/poses/transforms.h"

namespace ist {
namespace {

constexpr double kStampResolution = 1e-3;  // [s]

}  // namespace

JointPoseSource::JointPoseSource(std::shared_ptr<const Kinematics> kinematics,
                                 JointStateListener* joints, JointStateListener::Which which,
                                 const TransformBuffer& buffer, const std::string& fixed_frame,
                                 const std::vector<std::string>& links,
                                 const std::vector<bool>& wanted, double timeout)
    : KinematicPoseSource(std::move(kinematics), buffer, fixed_frame, links, wanted, timeout),
      listener_(*joints),
      which_(which),
      tf_source_(buffer, fixed_frame, links, wanted, timeout) {
  const auto& tree = kinematics_->joints();
  moved_by_.resize(links.size());
  matters_.assign(tree.size(), false);
  for (std::size_t i = 0; i < links.size(); ++i) {
    if (!wanted_[i]) continue;
    std::size_t body = kinematics_->find_body(links[i]).value_or(0);
    for (; body > 0; body = tree[body - 1].parent) {
      const std::size_t source = tree[body - 1].source;
      if (!tree[source].is_free()) continue;
      moved_by_[i].push_back(body - 1);
      for (std::size_t at = body - 1; !matters_[at]; at = tree[at].leader) matters_[at] = true;
    }
  }
}

std::string JointPoseSource::hint() const {
  return "does everything that moves joints publish on '" + listener_.topic() + "'?";
}

/// Says why a joint's newest position cannot be used, whatever the other joints' are.
PoseProblem JointPoseSource::problem_of(std::size_t joint, const ros::Time& now) const {
  const JointPosition& position = positions_[joint];
  const auto name = [&] { return "joint '" + kinematics_->joints()[joint].name + "'"; };
  const auto cause = [&] { return position.refusal ? ": " + *position.refusal : std::string(); };
  if (position.stamp.isZero()) {
    if (position.refusal) {
      return {"no position of " + name() + " could be used yet" + cause(), true};
    }
    return {name() + " has not come in any joint state", false};
  }
  const double age = seconds_between(position.stamp, now);
  if (age > timeout_) {
    return {"the newest position of " + name() +
                format_text(" is %.2f s old, allowed is %.2f s (~pose_timeout)", age, timeout_) +
                cause(),
            position.refusal != nullptr};
  }
  const Kinematics::Joint& at = kinematics_->joints()[joint];
  const auto& bodies = kinematics_->bodies();
  const std::string dispute = buffer_.dispute(bodies[at.parent], bodies[at.child]);
  return {dispute.empty() ? "" : name() + ": " + dispute, !dispute.empty()};
}

/// Whether a joint is later than its samples usually are: by more than one and a half times its
/// usual spacing behind a joint that came in the same message before; behind the newest one, whose
/// publisher may be another, by more than kHeldIntervals times the spacing and kLag.
/// @returns empty, or a sentence
std::string JointPoseSource::is_late(std::size_t joint, std::size_t newest) const {
  const JointPosition& position = positions_[joint];
  const std::string& name = kinematics_->joints()[joint].name;
  const auto sentence = [&](std::size_t other, double lag) {
    return "the newest position of joint '" + name + "' that can be used is " +
           format_text("%.3f s older than that of joint '", lag) +
           kinematics_->joints()[other].name + "'" +
           (position.refusal ? ": " + *position.refusal
                             : format_text("; its samples come every %.3f s", position.spacing));
  };
  const double lag = seconds_between(position.stamp, positions_[newest].stamp);
  if (lag <= 0.0) return "";
  if (position.is_missing) return sentence(newest, lag);
  const JointPosition& companion = positions_[position.companion];
  const double behind = seconds_between(position.stamp, companion.stamp);
  double spacing = position.spacing > 0.0 ? position.spacing : companion.spacing;
  if (spacing > 0.0 && behind > 1.5 * spacing + kStampResolution) {
    return sentence(position.companion, behind);
  }
  spacing = position.spacing > 0.0 ? position.spacing : positions_[newest].spacing;
  if (lag > kHeldIntervals * spacing + kLag) return sentence(newest, lag);
  return "";
}

/// Reads the positions that can be used, and notes why the others cannot.
/// @returns the newest stamp of a usable position; 0 when there is none
ros::Time JointPoseSource::read_positions(const ros::Time& now) {
  const auto& joints = kinematics_->joints();
  listener_.read(which_, *kinematics_, &positions_);
  positions_.resize(joints.size());
  q_.assign(joints.size(), std::nan(""));
  velocities_.assign(joints.size(), std::nan(""));
  joint_problems_.assign(joints.size(), PoseProblem());
  std::size_t newest = joints.size();
  for (std::size_t j = 0; j < joints.size(); ++j) {
    if (!has_own(j)) continue;
    joint_problems_[j] = problem_of(j, now);
    if (!joint_problems_[j].empty()) continue;
    if (newest == joints.size() || positions_[j].stamp > positions_[newest].stamp) newest = j;
  }
  if (newest == joints.size()) return ros::Time();
  for (std::size_t j = 0; j < joints.size(); ++j) {
    if (!has_own(j) || !joint_problems_[j].empty()) continue;
    joint_problems_[j] = {is_late(j, newest), true};
    if (!joint_problems_[j].empty()) continue;
    q_[j] = positions_[j].q;
    // The last velocity is not that of a joint whose newer samples are refused.
    if (!positions_[j].refusal) velocities_[j] = positions_[j].velocity;
  }
  return positions_[newest].stamp;
}

/// Whether a joint's own position counts: a mimic joint has none while nobody states it.
bool JointPoseSource::has_own(std::size_t joint) const {
  const Kinematics::Joint& at = kinematics_->joints()[joint];
  if (at.source == joint) return at.is_free();
  return !positions_[joint].stamp.isZero() || positions_[joint].refusal;
}

/// Whether a joint that matters is behind the instant because its newest sample was refused.
bool JointPoseSource::must_hold(const ros::Time& instant) const {
  for (std::size_t j = 0; j < positions_.size(); ++j) {
    if (!matters_[j] || std::isnan(q_[j])) continue;
    if (positions_[j].refusal && positions_[j].stamp < instant) return true;
  }
  return false;
}

/// A joint that comes less often than others keeps its position until its next sample: it moves on
/// as fast as it did of late, or as it says, and speeds up as it did of late; until that is known,
/// as fast as its limit. A constant acceleration a is allowed for: with stamps T1 and T2 apart the
/// rates between them differ by a (T1 + T2) / 2, and the mean rate since is a (T2 + lag) / 2 more
/// than the last one.
void JointPoseSource::find_lags(const ros::Time& instant) {
  const auto& joints = kinematics_->joints();
  lags_.assign(joints.size(), {0.0, 0.0, 0.0});
  bool is_any_late = false;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    if (!has_own(j) || std::isnan(q_[j])) continue;
    const JointPosition& position = positions_[j];
    const double lag = seconds_between(position.stamp, instant);
    if (!(lag > 0.0)) continue;
    const double change = std::abs(position.rate - position.rate_before);
    const double share = (position.interval + lag) / (position.interval_before + position.interval);
    double speed = std::fmax(std::abs(position.rate), std::abs(position.velocity));
    if (std::isnan(change)) {
      speed = std::fmax(speed, joints[j].speed);
    } else {
      speed += change * std::max(1.0, share);
      // A rate above the joint's limit that it did not have before is a jump of what is stated.
      const double most = std::fmax(joints[j].speed, std::abs(position.velocity));
      if (!(position.rate * position.rate_before > 0.0)) speed = std::fmin(speed, most);
    }
    if (!std::isfinite(speed)) {
      q_[j] = std::nan("");
      joint_problems_[j] = {
          "of joint '" + joints[j].name + "' less than three positions have come, the last " +
              format_text("%.3f s ago, and the URDF has no limit of its velocity", lag),
          true};
      continue;
    }
    lags_[j].distance = speed * lag;
    is_any_late = is_any_late || lags_[j].distance > 0.0;
  }
  for (const std::size_t j : kinematics_->mimics()) {
    if (has_own(j)) continue;
    lags_[j].distance = std::abs(joints[j].mimic.multiplier) * lags_[joints[j].leader].distance;
  }
  if (!is_any_late) lags_.clear();
}

void JointPoseSource::describe_doubts(StampedLinkPoses* poses) const {
  const auto& joints = kinematics_->joints();
  const auto& bodies = kinematics_->bodies();
  poses->add_doubt(doubt_of_pose(buffer_, fixed_frame_, bodies[0]));
  for (std::size_t j = 0; j < joints.size(); ++j) {
    if (joints[j].has_unstated_pose()) {
      poses->add_doubt(doubt_of_pose(buffer_, bodies[joints[j].parent], bodies[joints[j].child]));
    }
    if (!matters_[j] || std::isnan(q_[j]) || !positions_[j].is_implausible) continue;
    poses->add_doubt("joint '" + joints[j].name +
                     format_text("' is at %g, far outside its limits of %g to %g: is its "
                                 "unit right?",
                                 q_[j], joints[j].lower, joints[j].upper));
  }
}

/// Looks up the pose of a child frame in its parent at the instant. Notes that tf is behind when it
/// has a fresh pose for an earlier instant only.
bool JointPoseSource::look_up_in_tf(const std::string& parent, const std::string& child,
                                    const ros::Time& now, const ros::Time& instant,
                                    Eigen::Isometry3d* X, PoseProblem* problem) {
  if (is_known(buffer_, parent, child, instant, &problem->text)) {
    problem->text = ist::look_up(buffer_, parent, child, instant, X);
    // Transforms that are stamped ahead are known for longer than their publisher lives.
    const double age = seconds_between(buffer_.counts_from(parent, child, instant), now);
    if (problem->empty() && age > timeout_) {
      problem->text = too_old(parent, child, age, timeout_);
    }
    problem->explained = !problem->empty();
    return problem->empty();
  }
  problem->text = with_cause(buffer_, parent, child, problem->text, &problem->explained);
  ros::Time stamp;
  Eigen::Isometry3d ignored;
  if (ist::look_up(buffer_, parent, child, ros::Time(), &ignored, &stamp).empty() &&
      stamp < instant && seconds_between(stamp, now) <= timeout_) {
    tf_is_behind_ = true;
  }
  return false;
}

void JointPoseSource::look_up(const ros::Time& now, StampedLinkPoses* poses) {
  const ros::Time last = poses->stamp;
  ros::Time instant = now.isZero() ? ros::Time() : read_positions(now);
  if (!now.isZero() && last_.stamp == last && last_.count_known() > 0 && must_hold(instant)) {
    velocities_.clear();
    *poses = last_;
    return;
  }
  reset(now, poses);
  tf_is_behind_ = false;
  if (now.isZero()) return poses->set_problem(wanted_, {"the ROS clock has not started", true});
  if (!instant.isZero() && instant < last) {
    poses->stamp = last;
    return poses->set_problem(wanted_, {"the joint states are from before the last answer", true});
  }
  if (instant.isZero()) instant = poses->stamp;
  find_lags(instant);

  kinematics_->place_joints(q_, &joints_);
  const auto& joints = kinematics_->joints();
  for (std::size_t j = 0; j < joints.size(); ++j) {
    if (!joints[j].has_unstated_pose()) continue;
    joints_.known[j] = look_up_in_tf(kinematics_->bodies()[joints[j].parent],
                                     kinematics_->bodies()[joints[j].child], now, instant,
                                     &joints_.X_PC[j], &joint_problems_[j]);
  }
  PoseProblem root_problem;
  const bool root_known =
      look_up_in_tf(fixed_frame_, kinematics_->bodies()[0], now, instant, &X_FR_, &root_problem);
  // A mimic joint is unknown for the same reason as the joint that it follows, or its own.
  for (const std::size_t j : kinematics_->mimics()) {
    if (!has_own(j)) joint_problems_[j] = joint_problems_[joints[j].leader];
    joints_.known[j] = joints_.known[j] && joint_problems_[j].empty();
  }
  poses->stamp = instant;
  if (tf_is_behind_) {
    poses->stamp = last;
    look_up_behind(now, poses);
  } else if (root_known) {
    place(joint_problems_, poses);
  } else {
    poses->set_problem(wanted_, root_problem);
  }
  describe_doubts(poses);
  last_ = *poses;
}

/// Takes all poses from tf, at the newest instant that it knows.
void JointPoseSource::look_up_behind(const ros::Time& now, StampedLinkPoses* poses) {
  velocities_.clear();  // those are of a later instant
  lags_.clear();        // tf knows all joints at its instant
  tf_source_.look_up(now, poses);
  for (std::size_t i = 0; i < moved_by_.size(); ++i) {
    for (const std::size_t j : moved_by_[i]) {
      if (joint_problems_[j].empty()) continue;
      poses->known[i] = false;
      poses->problems[i] = joint_problems_[j];
    }
  }
}

void JointPoseSource::look_up_all(const Kinematics& kinematics, const ros::Time& instant,
                                  BodyPoses* bodies) {
  if (tf_is_behind_) return tf_source_.look_up_all(kinematics, instant, bodies);
  KinematicPoseSource::look_up_all(kinematics, instant, bodies);
}

std::unique_ptr<PoseSource> make_pose_source(const ModelState& model, const ServerConfig& config,
                                             const TransformBuffer& buffer,
                                             JointStateListener* joints,
                                             JointStateListener::Which which) {
  const std::string fixed_frame = fixed_frame_of(model, config);
  const std::vector<std::string> names = link_names(*model.robot);
  const std::vector<bool> wanted = wanted_links(model);
  if (!joints) {
    return std::make_unique<TfPoseSource>(buffer, fixed_frame, names, wanted, config.pose_timeout);
  }
  if (!model.kinematics) return nullptr;
  return std::make_unique<JointPoseSource>(model.kinematics, joints, which, buffer, fixed_frame,
                                           names, wanted, config.pose_timeout);
}

}  // namespace ist
