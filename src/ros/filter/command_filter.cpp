#include "ros/filter/command_filter.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iterator>
#include <stdexcept>
#include <type_traits>
#include <utility>

#include "internal/geometry/numbers.h"
#include "ist_proximity/geometry/error.h"
#include "ist_proximity/robot/robot_description.h"
#include "ros/common/eigen_conversion.h"
#include "ros/common/frame_name.h"
#include "ros/common/publish.h"
#include "ros/common/ros_time.h"
#include "ros/common/text.h"
#include "ros/output/message_conversion.h"

namespace ist {
namespace {

using Clock = std::chrono::steady_clock;
using ist_proximity::FilterState;

// [rad/s, m/s] What rounding makes of a velocity.
constexpr double kNegligible = 1e-8;
// [s] Over which the speed of joints that are not commanded is measured.
constexpr double kSpeedWindow = 0.05;
// [rad/s, m/s] Joints whose velocity the URDF does not limit: no arm is faster.
constexpr double kMaxSpeed = 10.0;
// [s] The solver ends by then, and the command is scaled: a hundred times what it takes as a rule.
constexpr double kTimeLimit = 0.0005;
// Joints that are commanded apart have commands that come at once: none takes another's place.
constexpr std::uint32_t kQueue = 10;
// Zeros where commands or data are late come this often, as commands do.
const ros::WallDuration kZeroPeriod(0.01);
// [s] For so long, joints that are not commanded any more are given 0 beside others that are.
constexpr double kHalted = 0.5;
// Steps of a simulated clock are shorter.
constexpr std::chrono::milliseconds kClockStands(300);
// Time in which the last velocity leaves: roscpp sends by another thread, and drops what a
// publisher has not sent when it goes.
const ros::WallDuration kLeave(0.1);

FilterConfig read_config(const ros::NodeHandle& private_nh) {
  XmlRpc::XmlRpcValue tree;
  ros::param::get(private_nh.getNamespace(), tree);
  std::vector<std::string> errors, warnings;
  FilterConfig config = read_filter_config(tree, &errors, &warnings);
  for (const std::string& warning : warnings) ROS_WARN_STREAM(warning);
  if (!errors.empty()) throw std::invalid_argument(join(errors, "\n"));
  return config;
}

template <class Message>
void set_stamp(const ros::Time& now, Message* message) {
  constexpr bool is_trajectory = std::is_same_v<Message, trajectory_msgs::JointTrajectory>;
  if constexpr (ros::message_traits::HasHeader<Message>::value) {
    // A stamp of 0 means "now" to those who follow a trajectory.
    if (!is_trajectory || !message->header.stamp.isZero()) message->header.stamp = now;
  }
}

}  // namespace

CommandFilter::CommandFilter(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh)
    : nh_(nh),
      private_nh_(private_nh),
      config_(read_config(private_nh)),
      listener_(tf_, nh_),
      joints_are_stated_(!config_.joints.empty()) {
  if (!nh_.searchParam("robot_description", description_)) description_ = "robot_description";
  state_ = private_nh_.advertise<FilterState>("filter_state", 10);
  scale_ = private_nh_.advertise<std_msgs::Float64>("speed_scale", 10);
  markers_ = private_nh_.advertise<visualization_msgs::MarkerArray>("filter_markers", 1);
  read_robot();
  const auto hints = ros::TransportHints().tcpNoDelay();
  if (config_.self_proximity) {
    self_answers_ = nh_.subscribe<ist_proximity::ProximityArray>(
        "proximity/self_proximity", 1, [this](const auto& answers) { take(answers, &self_); }, {},
        hints);
  }
  answers_ = nh_.subscribe<ist_proximity::ProximityArray>(
      "proximity/proximity", 1, [this](const auto& answers) { take(answers, &obstacles_); }, {},
      hints);
  joints_ = nh_.subscribe("joint_states", 50, &CommandFilter::take_joints, this, hints);
  node_scale_ = nh_.subscribe("proximity/speed_scale", 1, &CommandFilter::take_scale, this, hints);
  subscribe<trajectory_msgs::JointTrajectory, std_msgs::Float64MultiArray, sensor_msgs::JointState,
            geometry_msgs::TwistStamped, geometry_msgs::Twist>();
  timer_ = nh_.createWallTimer(kZeroPeriod, [this](const ros::WallTimerEvent&) { on_timer(); });
}

CommandFilter::~CommandFilter() {
  timer_.stop();
  command_.shutdown();
  publish_number(0.0, scale_);
  halt("the filter ends");
  kLeave.sleep();
}

/// Subscribes to commands as the type of these that ~command_type names.
template <class Message, class... Others>
void CommandFilter::subscribe() {
  if constexpr (sizeof...(Others) > 0) {
    if (config_.command_type != ros::message_traits::datatype<Message>()) {
      return subscribe<Others...>();
    }
  }
  safe_command_ = private_nh_.advertise<Message>("safe_command", 1);
  command_ = private_nh_.subscribe<Message>(
      "command", kQueue,
      boost::function<void(const boost::shared_ptr<const Message>&)>(
          [this](const boost::shared_ptr<const Message>& message) { receive(*message); }),
      ros::VoidConstPtr(), ros::TransportHints().tcpNoDelay());
}

template <class Message>
void CommandFilter::receive(const Message& message) {
  const auto begin = Clock::now();
  clock_has_gone_back();
  const auto q = [this](const std::string& joint) { return position_of(joint); };
  const JointCommand command = read_command(message, {config_.joints, q, kinematics_, config_.tool,
                                                      ros::Time::now(), config_.command_timeout});
  const auto give = [this, q, message, command](const std::vector<double>& velocity,
                                                FilterState* state, double time) {
    Message given = message;
    set_velocity(command, velocity, q, &given);
    set_stamp(state->header.stamp, &given);
    publish_message(safe_command_, given);
    state->joints = command.joints;
    state->velocity = velocity;
    state->computation_time = time;
    note_given(*state, command.jacobian.size() > 0);
    publish_message(state_, *state);
  };
  FilterState state;
  const std::vector<double> velocity = filter(command, &state);
  last_command_ = state.header.stamp;
  publish_number(given_scale_, scale_);
  // Nobody could use 0 for joints that the robot lacks: those that were commanded before stop.
  const bool is_usable = can_be_used(command);
  if (!is_usable && !groups_.empty()) {
    for (Group& group : groups_) group.last_command = last_command_;
    return halt(state.status_text);
  }
  give(velocity, &state, std::chrono::duration<double>(Clock::now() - begin).count());
  Group group;
  group.last_command = last_command_;
  if (is_usable) group.joints = command.joints;
  std::sort(group.joints.begin(), group.joints.end());
  group.halt = [this, give, command](const std::string& reason) {
    FilterState none;
    none.header.stamp = ros::Time::now();
    none.header.frame_id = kinematics_ ? kinematics_->bodies()[0] : "";
    none.status = FilterState::FAULT;
    none.status_text = reason;
    none.command.assign(command.joints.size(), kNaN);
    if (filter_) filter_->reset();
    give(std::vector<double>(command.joints.size(), 0.0), &none, 0.0);
  };
  // Joints that this command does not name go on, and stop in their own time. Twists replace all.
  const auto is_replaced = [&](const Group& other) {
    return command.jacobian.size() > 0 || std::includes(group.joints.begin(), group.joints.end(),
                                                        other.joints.begin(), other.joints.end());
  };
  groups_.erase(std::remove_if(groups_.begin(), groups_.end(), is_replaced), groups_.end());
  groups_.push_back(std::move(group));
}

void CommandFilter::halt(const std::string& reason) {
  for (const Group& group : groups_) group.halt(reason);
}

/// Gives 0 for joints whose last command is too old; others may be commanded still.
void CommandFilter::halt_late(const ros::Time& now) {
  const auto age = [&now](const Group& group) { return seconds_between(group.last_command, now); };
  for (const Group& group : groups_) {
    if (age(group) <= config_.command_timeout) continue;
    group.halt(format_text("the last command came %.2f s ago; ~command_timeout is %g s", age(group),
                           config_.command_timeout));
  }
  if (groups_.empty()) return;
  const auto last = std::prev(groups_.end());
  const auto has_halted = [&](const Group& group) {
    return age(group) > config_.command_timeout + kHalted;
  };
  groups_.erase(std::remove_if(groups_.begin(), last, has_halted), last);
}

/// Reads the URDF, or another one that has taken its place since.
void CommandFilter::read_robot() {
  std::string urdf;
  if (kinematics_) {
    if (!nh_.getParamCached(description_, urdf) || urdf == urdf_) return;
    forget_robot();
  } else if (!nh_.getParam(description_, urdf)) {
    robot_fault_ = "waiting for the parameter '" + nh_.resolveName(description_) + "'";
    return;
  }
  try {
    // Boxes about the shapes come with the answers: no package is looked for.
    const auto no_packages = [](const std::string&) { return std::string(); };
    kinematics_ = std::make_shared<const Kinematics>(
        parse_urdf(urdf, GeometrySource::kCollision, no_packages));
  } catch (const ModelError& error) {
    robot_fault_ = "the URDF in '" + nh_.resolveName(description_) + "': " + error.what();
    return;
  }
  robot_fault_.clear();
  urdf_ = urdf;
  history_.emplace(kinematics_);
  proximity_.emplace(kinematics_);
  filter_.emplace(joint_limits(*kinematics_, kMaxSpeed), std::vector<double>(),
                  config_.rows.horizon);
  const std::size_t columns = proximity_->joints().size();
  command_column_.assign(columns, 0.0);
  q_column_.assign(columns, 0.0);
  if (joints_are_stated_) return;
  config_.joints.clear();
  for (const std::size_t j : proximity_->joints()) {
    config_.joints.push_back(kinematics_->joints()[j].name);
  }
}

void CommandFilter::forget_robot() {
  halt("the robot's URDF is another one");
  obstacles_ = self_ = PlacedAnswers();
  given_.clear();
  filter_.reset();
  proximity_.reset();
  history_.reset();
  kinematics_.reset();
}

void CommandFilter::take_joints(const sensor_msgs::JointState& message) {
  clock_has_gone_back();
  if (history_) history_->add(message, ros::Time::now());
}

void CommandFilter::take_scale(const std_msgs::Float64& scale) {
  newest_scale_ = scale.data >= 0.0 && scale.data <= 1.0 ? scale.data : 0.0;
  newest_scale_came_ = ros::Time::now();
}

void CommandFilter::take(const ist_proximity::ProximityArray::ConstPtr& answers,
                         PlacedAnswers* placed) {
  clock_has_gone_back();
  if (!proximity_) return;
  const std::string frame = without_slash(answers->header.frame_id);
  const std::string& root = kinematics_->bodies()[0];
  *placed = PlacedAnswers();
  placed->message = answers;
  if (frame != root) {
    try {
      const auto transform = tf_.lookupTransform(root, frame, answers->header.stamp).transform;
      placed->fault = to_isometry(transform, &placed->X_RF);
    } catch (const tf2::TransformException& error) {
      placed->fault = error.what();
    }
  }
  if (!placed->fault.empty()) {
    placed->fault = "the distances are in '" + frame + "', which is not placed in '" + root +
                    "': " + placed->fault;
  }
  if (obstacles_.message) proximity_->set(obstacles_.message, self_.message);
}

bool CommandFilter::clock_has_gone_back() {
  const ros::Time now = ros::Time::now();
  const bool has = now < last_now_;
  if (now != last_now_) clock_moved_ = std::chrono::steady_clock::now();
  last_now_ = now;
  if (!has) return false;
  tf_.clear();
  if (history_) history_->clear();
  obstacles_ = self_ = PlacedAnswers();
  newest_scale_ = 0.0;
  given_.clear();
  last_command_ = now;
  for (Group& group : groups_) group.last_command = now;
  halt("the clock has gone back");
  return true;
}

void CommandFilter::on_timer() {
  read_robot();
  if (clock_has_gone_back()) return;
  const ros::Time now = ros::Time::now();
  const double age = seconds_between(last_command_, now);
  if (groups_.empty() || age > config_.command_timeout) {
    const bool is_fresh = seconds_between(newest_scale_came_, now) <= config_.proximity_timeout;
    publish_number(is_fresh ? newest_scale_ : 0.0, scale_);
  }
  halt_late(now);
}

std::optional<std::size_t> CommandFilter::column_of(const std::string& joint) const {
  const auto& columns = proximity_->joints();
  for (std::size_t c = 0; c < columns.size(); ++c) {
    if (kinematics_->joints()[columns[c]].name == joint) return c;
  }
  return std::nullopt;
}

bool CommandFilter::can_be_used(const JointCommand& command) const {
  return command.fault.empty() && kinematics_ &&
         std::all_of(command.joints.begin(), command.joints.end(),
                     [this](const std::string& joint) { return column_of(joint).has_value(); });
}

double CommandFilter::position_of(const std::string& joint) const {
  const auto index = kinematics_ ? kinematics_->find_joint(joint) : std::nullopt;
  return index ? history_->newest(*index) : kNaN;
}

std::string CommandFilter::why_not(const JointCommand& command, const ros::Time& now) const {
  if (!command.fault.empty()) return command.fault;
  if (!kinematics_) return robot_fault_;
  if (command_.getNumPublishers() > 1) {
    return format_text("%u nodes publish on '%s'; only one may command",
                       command_.getNumPublishers(), command_.getTopic().c_str());
  }
  for (const std::string& joint : command.joints) {
    if (column_of(joint)) continue;
    return "the robot has no joint '" + joint + "' with a position of its own";
  }
  if (std::chrono::steady_clock::now() - clock_moved_ > kClockStands) {
    return "the clock stands still, so that nobody knows how old anything is";
  }
  std::string late = history_->late_joint(now, config_.joint_timeout);
  if (!late.empty()) return late;
  for (const std::size_t j : proximity_->joints()) {
    const std::string& name = kinematics_->joints()[j].name;
    const auto& joints = command.joints;
    if (std::find(joints.begin(), joints.end(), name) != joints.end()) continue;
    if (std::isfinite(history_->velocity(j, kSpeedWindow))) continue;
    return "joint '" + name + "' is not commanded, and how fast it moves is not known yet";
  }
  std::string fault = why_not(obstacles_, answers_, now);
  if (!config_.self_proximity || !fault.empty()) return fault;
  fault = why_not(self_, self_answers_, now);
  if (!fault.empty()) return fault;
  const ist_proximity::ProximityArray& self = *self_.message;
  const bool is_measured = self.status != ist_proximity::ProximityArray::LOADING &&
                           self.status != ist_proximity::ProximityArray::MODEL_ERROR;
  if (!is_measured) return "no distances from link to link: " + self.status_text;
  const std::string& link = proximity_->other_geometry();
  return link.empty() ? ""
                      : "the distances from link to link are of another geometry of '" + link +
                            "' than those to obstacles";
}

std::string CommandFilter::why_not(const PlacedAnswers& placed, const ros::Subscriber& subscriber,
                                   const ros::Time& now) const {
  if (!placed.message) return "no distances have come on '" + subscriber.getTopic() + "' yet";
  const ist_proximity::ProximityArray& answers = *placed.message;
  if (answers.links.empty()) return "the distances are of no link: " + answers.status_text;
  const double age = seconds_between(answers.header.stamp, now);
  if (age > config_.proximity_timeout) {
    return format_text("the distances of '%s' are %.2f s old; ~proximity_timeout is %g s",
                       subscriber.getTopic().c_str(), age, config_.proximity_timeout);
  }
  if (age < -kToldSkew) {
    return format_text("the distances are %.2f s ahead of the clock; compare the clocks", -age);
  }
  for (const ist_proximity::SourceStatus& source : answers.sources) {
    // NaN: there is no self-filter.
    if (!(source.blind_skin < 0.0) && !std::isinf(source.blind_skin)) continue;
    return format_text("the blind_skin of source '%s' is %g m in '%s'; it has to be 0 m or more",
                       source.name.c_str(), source.blind_skin, subscriber.getTopic().c_str());
  }
  return placed.fault;
}

std::vector<double> CommandFilter::filter(const JointCommand& command, FilterState* state) {
  const ros::Time now = ros::Time::now();
  state->header.stamp = now;
  state->header.frame_id = kinematics_ ? kinematics_->bodies()[0] : "";
  state->command = command.velocity;
  given_scale_ = 0.0;
  std::vector<double> velocity(command.joints.size(), 0.0);
  state->status_text = why_not(command, now);
  for (PlacedAnswers* placed : {&obstacles_, &self_}) {
    if (!state->status_text.empty() || !placed->message) continue;
    if (history_->at(placed->message->header.stamp, &placed->q, &placed->moved)) continue;
    state->status_text = "the joint states do not reach back to the distances' stamp";
  }
  if (!state->status_text.empty()) {
    state->status = FilterState::FAULT;
    if (filter_) filter_->reset();
    return velocity;
  }
  const FilterAnswer& answer = run(command, now);
  given_scale_ = answer.scale;
  for (std::size_t i = 0; i < velocity.size(); ++i) {
    velocity[i] = answer.velocity[*column_of(command.joints[i])];
  }
  explain(answer, state);
  if (markers_.getNumSubscribers() > 0) draw(answer, state->header);
  if (command.jacobian.size() == 0 || state->status != FilterState::LIMITED ||
      (!command.keeps_way && state->limited_joints.empty() && is_twist_proven(command, velocity))) {
    return velocity;
  }
  state->status = given_scale_ > 0.0 ? FilterState::SCALED : FilterState::STOPPED;
  for (std::size_t i = 0; i < velocity.size(); ++i) {
    velocity[i] = given_scale_ * command.velocity[i];
  }
  return velocity;
}

/// Who receives a twist makes it with joint velocities of his own: with the least ones, it is
/// supposed. Those have to pass as they are.
bool CommandFilter::is_twist_proven(const JointCommand& command,
                                    const std::vector<double>& velocity) {
  const Eigen::Map<const Eigen::VectorXd> given(velocity.data(), command.jacobian.cols());
  const Eigen::VectorXd least = least_velocity(command.jacobian, command.jacobian * given);
  for (std::size_t i = 0; i < velocity.size(); ++i) {
    command_column_[*column_of(command.joints[i])] = least[static_cast<Eigen::Index>(i)];
  }
  const FilterAnswer& answer = filter_->run(command_column_, q_column_, rows_, kTimeLimit, went_);
  for (std::size_t c = 0; c < command_column_.size(); ++c) {
    if (!(std::abs(answer.velocity[c] - command_column_[c]) <= kNegligible)) return false;
  }
  return true;
}

const FilterAnswer& CommandFilter::run(const JointCommand& command, const ros::Time& now) {
  const ist_proximity::ProximityArray& answers = *obstacles_.message;
  history_->at(now, &q_now_);
  RowConfig config = config_.rows;
  config.age = std::max(config.age, obstacle_age(answers, now));
  // The robot has gone on since its joints were stated.
  config.horizon += history_->age(now);
  config.approach_time = std::max(config.approach_time, config.horizon);
  rows_ = proximity_->rows(obstacles_, self_, q_now_, config, config_.self_stop_distance);

  std::vector<bool> is_commanded(command_column_.size(), false);
  std::fill(command_column_.begin(), command_column_.end(), 0.0);
  for (std::size_t i = 0; i < command.joints.size(); ++i) {
    const std::size_t column = *column_of(command.joints[i]);
    is_commanded[column] = true;
    command_column_[column] = command.velocity[i];
  }
  for (std::size_t c = 0; c < q_column_.size(); ++c) q_column_[c] = q_now_[proximity_->joints()[c]];
  hold_others(is_commanded, now);
  take_off_given(now, config_.rows.horizon);
  return filter_->run(command_column_, q_column_, rows_, kTimeLimit, went_);
}

/// Joints that are not commanded go on as they move now, or as they were told to since the joints
/// were stated: what they do comes off the limits, and their columns are 0.
void CommandFilter::hold_others(const std::vector<bool>& is_commanded, const ros::Time& now) {
  const double age = history_->age(now);
  for (std::size_t c = 0; c < is_commanded.size(); ++c) {
    if (is_commanded[c]) continue;
    double least = history_->velocity(proximity_->joints()[c], kSpeedWindow), most = least;
    double until = 0.0;  // [s] before now
    for (auto given = given_.rbegin(); given != given_.rend() && until <= age; ++given) {
      least = std::min(least, given->velocity[c]);
      most = std::max(most, given->velocity[c]);
      until = seconds_between(given->time, now);
    }
    const double speed = std::max(std::abs(least), std::abs(most));
    const auto column = static_cast<Eigen::Index>(c);
    for (Eigen::Index i = 0; i < static_cast<Eigen::Index>(rows_.count); ++i) {
      rows_.h[i] -= std::max(rows_.G(i, column) * least, rows_.G(i, column) * most);
      rows_.sweep_limit[i] = std::max(0.0, rows_.sweep_limit[i] - rows_.sweep(i, column) * speed);
      rows_.G(i, column) = rows_.sweep(i, column) = 0.0;
    }
  }
}

/// Remembers a velocity for take_off_given() and hold_others(). Joints that it does not name go on
/// with the one before; a twist replaces all.
void CommandFilter::note_given(const FilterState& state, bool replaces_all) {
  if (!proximity_) return;
  std::vector<double> velocity(proximity_->joints().size(), 0.0);
  if (!given_.empty() && !replaces_all) velocity = given_.back().velocity;
  for (std::size_t i = 0; i < state.joints.size(); ++i) {
    const auto column = column_of(state.joints[i]);
    if (column) velocity[*column] = state.velocity[i];
  }
  given_.push_back({state.header.stamp, std::move(velocity)});
  // A joint state that counts is no older; the first velocity was given before that.
  while (given_.size() > 1 &&
         seconds_between(given_[1].time, state.header.stamp) > config_.joint_timeout) {
    given_.pop_front();
  }
}

/// The way that velocities have used which were given since the joints were stated comes off what
/// points of a link may move: these were other velocities than the present one.
void CommandFilter::take_off_given(const ros::Time& now, double horizon) {
  const double age = history_->age(now);
  Eigen::VectorXd moved = Eigen::VectorXd::Zero(rows_.sweep.cols());
  went_.assign(static_cast<std::size_t>(moved.size()), 0.0);
  double until = 0.0;  // [s] before now
  for (auto given = given_.rbegin(); given != given_.rend() && until < age; ++given) {
    const double from = std::clamp(seconds_between(given->time, now), until, age);
    const Eigen::Map<const Eigen::VectorXd> velocity(given->velocity.data(), moved.size());
    moved += (from - until) * velocity.cwiseAbs();
    for (std::size_t c = 0; c < went_.size(); ++c) went_[c] += (from - until) * given->velocity[c];
    until = from;
  }
  for (Eigen::Index i = 0; i < static_cast<Eigen::Index>(rows_.count); ++i) {
    if (!rows_.origins[static_cast<std::size_t>(i)].is_proven) continue;
    const double left = rows_.sweep_limit[i] * rows_.horizon - rows_.sweep.row(i).dot(moved);
    rows_.sweep_limit[i] = std::clamp(left / horizon, 0.0, rows_.sweep_limit[i]);
  }
}

}  // namespace ist
