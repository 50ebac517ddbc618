#include "ros/trajectory/trajectory_watch.h"

#include <actionlib_msgs/GoalID.h>
#include <visualization_msgs/MarkerArray.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "internal/geometry/numbers.h"
#include "internal/proximity/carried_worlds.h"
#include "ros/common/stopwatch.h"
#include "ros/common/text.h"
#include "ros/model/counted_links.h"
#include "ros/output/message_conversion.h"

namespace ist {
namespace {

// An answer is given as often as this, and with every new cloud.
constexpr std::chrono::milliseconds kPeriod(100);
constexpr double kWakeUp = 0.01;  // [s]
constexpr std::size_t kMaxJoints = 10000;

// The trajectory says which links move, in whatever frame distances are.
ServerConfig with_fixed_links(ServerConfig config) {
  config.fixed_links_count = true;
  return config;
}

}  // namespace

std::unique_ptr<AddOn> make_trajectory(const AddOnContext& node) {
  return std::make_unique<TrajectoryWatch>(node);
}

TrajectoryWatch::TrajectoryWatch(const AddOnContext& node)
    : node_(node),
      config_(with_fixed_links(node.config)),
      stated_(node, StatedPoseSource::Stamp::kNow) {
  publisher_ = node_.private_nh.advertise<Message>("trajectory_clearance", 10);
  markers_ = node_.private_nh.advertise<visualization_msgs::MarkerArray>("trajectory_markers", 1);
  if (!config_.trajectory.cancel_topic.empty()) {
    cancel_ = node_.nh.advertise<actionlib_msgs::GoalID>(config_.trajectory.cancel_topic, 10);
  }
}

void TrajectoryWatch::subscribe(ros::CallbackQueue* queue) {
  node_.nh.setCallbackQueue(queue);
  node_.private_nh.setCallbackQueue(queue);
  trajectories_ = node_.private_nh.subscribe("trajectory", 10, &TrajectoryWatch::receive, this);
}

void TrajectoryWatch::receive(const Event& event) {
  received_ = event.getConstMessage();
  received_time_ = event.getReceiptTime();  // before it waited for this thread
  is_watching_ = true;
  last_look_ = Clock::time_point();
  if (states_) return timer_.start();
  // Whoever sends no trajectory pays for nothing.
  listening_since_ = Clock::now();
  states_ = node_.nh.subscribe("joint_states", 100, &TrajectoryWatch::receive_state, this);
  timer_ = node_.private_nh.createWallTimer(ros::WallDuration(kWakeUp),
                                            [this](const ros::WallTimerEvent&) { run_when_due(); });
}

void TrajectoryWatch::receive_state(const sensor_msgs::JointStateConstPtr& message) {
  const std::size_t count = std::min(message->name.size(), message->position.size());
  if (positions_.size() + count > kMaxJoints) positions_.clear();
  for (std::size_t i = 0; i < count; ++i) {
    if (!std::isfinite(message->position[i])) continue;
    const double speed = i < message->velocity.size() ? message->velocity[i] : kNaN;
    positions_[message->name[i]] = {{message->position[i], speed}, Clock::now()};
  }
}

JointMotionNow TrajectoryWatch::present(const std::string& joint) const {
  const auto found = positions_.find(joint);
  const bool is_known =
      found != positions_.end() && Clock::now() - found->second.received <= kStateTimeout;
  return is_known ? found->second.motion : JointMotionNow{kNaN, kNaN};
}

// Reads the newest message. @returns empty, or why nothing can be watched now
std::string TrajectoryWatch::take_trajectory() {
  std::string problem = stated_.take_model();
  if (!problem.empty()) return problem;
  if (received_ && received_->points.empty()) {  // controllers stop at one
    received_.reset();
    is_watching_ = false;
    refusal_.clear();
    trajectory_ = WatchedTrajectory();
    return "";
  }
  if (received_) {
    // The first joint states may still be on their way.
    const bool needs_states = received_->points[0].time_from_start.toSec() > 0.0;
    const bool may_come = ros::Time::now() < received_time_ + ros::Duration(0.2);
    if (needs_states && positions_.empty() && may_come) return "joint states are waited for";
    const WatchedTrajectory before = std::exchange(trajectory_, WatchedTrajectory());
    refusal_ = read_trajectory(
        *received_, *stated_.model()->kinematics,
        [this](const std::string& joint) { return present(joint); }, received_time_, &trajectory_);
    note_before(before);
    received_.reset();
    model_ = stated_.model();
    if (!refusal_.empty()) {
      refusal_ =
          "the last trajectory is not watched, and neither is what ran before it: " + refusal_;
    }
  }
  if (!refusal_.empty()) return refusal_;
  if (model_->kinematics != stated_.model()->kinematics) {
    refusal_ = "the robot is another one since the trajectory came: send it again";
  }
  model_ = stated_.model();  // an object may be attached meanwhile
  const double wait = (followed_until_ - ros::Time::now()).toSec();
  if (refusal_.empty() && wait > 0.0) {
    return format_text("what is followed until this trajectory begins, in %.2f s, is not watched",
                       wait);
  }
  return refusal_;
}

// Controllers follow a trajectory until the one that replaces it begins.
void TrajectoryWatch::note_before(const WatchedTrajectory& before) {
  if (!before.pieces.times.empty() && before.start < trajectory_.start) {
    followed_until_ = std::max(followed_until_, before.instant(before.end()));
  }
  followed_until_ = std::min(followed_until_, trajectory_.start);
}

// Compares the robot with the trajectory, which is taken to begin in the turn that a joint without
// limits is in: its mimics may be elsewhere in another one. @returns empty, or which joint is where
std::string TrajectoryWatch::why_elsewhere(double time) {
  const std::vector<double> q = positions_at(trajectory_.pieces, time);
  for (const std::size_t joint : trajectory_.joints) {
    const Kinematics::Joint& one = model_->kinematics->joints()[joint];
    const std::string& name = one.name;
    const double q_now = present(name).q;
    if (std::isnan(q_now)) {
      return "the position of joint '" + name + "' is not known: joint_states must hold it";
    }
    const double off = one.way(q[joint], q_now);
    const double turns = q_now - q[joint] - off;  // [rad] whole ones
    for (std::vector<double>& at : trajectory_.pieces.positions) at[joint] += turns;
    if (std::abs(off) <= config_.trajectory.tolerance) continue;
    return format_text(
        "the robot does not follow the trajectory: joint '%s' is at %.3f and should be at %.3f, "
        "more than %g away",
        name.c_str(), q_now, q[joint], config_.trajectory.tolerance);
  }
  return "";
}

void TrajectoryWatch::run_when_due() {
  if (!is_watching_) return timer_.stop();
  const ros::Time now = ros::Time::now();
  cancel_when_due(now);
  Message message;
  message.header.stamp = now;
  const std::string problem = take_trajectory();
  if (!is_watching_) return publish(&message, Message::NONE, "no trajectory is watched");
  if (!problem.empty()) {
    if (Clock::now() - last_look_ < kPeriod) return;
    return publish(&message, Message::UNKNOWN, problem);
  }
  message.header.frame_id = fixed_frame_of(*model_, config_);
  message.start = trajectory_.start;
  message.end = trajectory_.instant(trajectory_.end());
  if (now >= message.end) {
    is_watching_ = false;
    return publish(&message, Message::NONE, "the trajectory is over");
  }
  look(now, &message);
}

// Answers where a cloud is new, or the last answer is old.
void TrajectoryWatch::look(const ros::Time& now, Message* message) {
  const double time = std::max((now - trajectory_.start).toSec(), 0.0);
  Stopwatch watch;
  LiveConfig live = node_.live();
  live.query.deadline = 0.0;
  std::string problem = why_elsewhere(time);
  if (problem.empty()) {
    problem = stated_.run(trajectory_.state(*model_->kinematics, time), live, &here_);
  }
  const SnapshotSpan clouds = stated_.cycle().clouds();
  const bool is_new = !std::equal(clouds.begin(), clouds.end(), clouds_.begin(), clouds_.end());
  if (!is_new && Clock::now() - last_look_ < kPeriod) return;
  clouds_.assign(clouds.begin(), clouds.end());
  if (!problem.empty()) return publish(message, Message::UNKNOWN, problem);
  std::vector<bool> wanted = stated_.measurable();
  const std::vector<bool> moved = moved_links(now);
  for (std::size_t i = 0; i < wanted.size(); ++i) wanted[i] = wanted[i] && moved[i];
  std::vector<LinkClearance> found;
  stated_.impacts(live.query)
      .run(trajectory_.pieces, time, stated_.poses().joints(), stated_.poses().X_FR(), wanted,
           clouds, stated_.cycle().worlds(), config_.trajectory.obstacle_speed,
           obstacle_age(now, time), &found);
  fill(found, moved, time, message);
  message->computation_time = took_ = watch.lap();
  publish(message, message->state, message->text);
}

// [s] For how long obstacles may have come nearer than they were measured when the robot is where
// the trajectory has it at `time`, now or once it begins: also while braking delays the robot.
double TrajectoryWatch::obstacle_age(const ros::Time& now, double time) const {
  const double age = std::max(ist::obstacle_age(here_, std::max(now, trajectory_.start)), 0.0);
  const double way = config_.deceleration.is_stated()
                         ? braking_way(trajectory_.pieces, time, trajectory_.end(),
                                       config_.deceleration.of(*model_->kinematics))
                         : 0.0;
  return age + (std::isfinite(way) ? way : 0.0);  // nothing helps where it cannot brake
}

// By link of the robot: whether it counts, and the trajectory moves it, or an object that the robot
// carries towards it.
std::vector<bool> TrajectoryWatch::moved_links(const ros::Time& now) const {
  const RobotModel& robot = *model_->robot;
  const Kinematics& kinematics = *model_->kinematics;
  const auto is_named = [&](std::size_t joint) {
    const std::vector<std::size_t>& moved = trajectory_.joints;
    return std::find(moved.begin(), moved.end(), joint) != moved.end();
  };
  const auto is_moved = [&](std::size_t body) {
    for (; body != 0; body = kinematics.joints()[body - 1].parent) {
      std::size_t joint = body - 1;
      while (!is_named(joint) && kinematics.joints()[joint].leader != joint) {
        joint = kinematics.joints()[joint].leader;  // a mimic moves with it
      }
      if (is_named(joint)) return true;
    }
    return false;
  };
  CarriedWorlds carried;
  carried.take(stated_.cycle().worlds(), kinematics);
  const bool moves_object =
      std::any_of(carried.frames().begin(), carried.frames().end(),
                  [&](const CarriedWorlds::Frame& frame) { return is_moved(frame.body); });
  std::vector<bool> links(robot.links.size(), false);
  const std::vector<bool> counts =
      counted_links(*model_, config_, node_.ignored_links(now), true).counts;
  for (std::size_t i = 0; i < counts.size(); ++i) {
    const std::size_t link = model_->monitored[i];
    const auto body = kinematics.find_body(robot.links[link].name);
    links[link] = counts[i] && body && (moves_object || is_moved(*body));
  }
  return links;
}

}  // namespace ist
