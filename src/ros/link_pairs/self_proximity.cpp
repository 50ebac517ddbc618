#include "ros/link_pairs/self_proximity.h"

#include <ros/console.h>

#include <algorithm>
#include <boost/make_shared.hpp>
#include <chrono>

#include "internal/proximity/deadline.h"
#include "ist_proximity/repulsion/self_repulsion.h"
#include "ros/common/exceptions.h"
#include "ros/common/publish.h"
#include "ros/common/thread_name.h"
#include "ros/cycle/cycle_message.h"
#include "ros/output/message_conversion.h"
#include "ros/poses/joint_pose_source.h"
#include "ros/services/pair_choice.h"

namespace ist {

using ist_proximity::ProximityArray;
using ist_proximity::ProximityArrayConstPtr;
using Clock = std::chrono::steady_clock;

std::unique_ptr<AddOn> make_link_pairs(const AddOnContext& node) {
  if (!node.config.self_collision.enabled) return nullptr;
  return std::make_unique<SelfProximity>(node);
}

SelfProximity::SelfProximity(const AddOnContext& node) : node_(node) {
  publisher_ = node_.private_nh.advertise<ProximityArray>("self_proximity", 10);
  thread_ = std::thread(&SelfProximity::run, this);
}

SelfProximity::~SelfProximity() {
  stop_signal_.stop();
  thread_.join();
}

ProximityArrayConstPtr SelfProximity::self_proximity(const ModelState& model) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  const bool is_of_model =
      newest_model_ && (newest_model_.get() == &model || is_refinement(*newest_model_, model));
  return is_of_model ? newest_ : nullptr;
}

void SelfProximity::publish(const ProximityArrayConstPtr& message) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    newest_ = message;
    newest_model_ = loaded_;
  }
  publish_message(publisher_, message);
}

void SelfProximity::run() {
  name_thread("ist self");
  const auto period = std::chrono::duration_cast<Clock::duration>(
      std::chrono::duration<double>(1.0 / SelfCollisionConfig::kRate));
  Clock::time_point next = Clock::now();
  while (true) {
    next = std::max(next + period, Clock::now());
    if (!stop_signal_.sleep_until(next)) return;
    const std::string fault = exception_of([this] {
      take_model();
      publish_once();
    });
    if (fault.empty()) continue;
    ROS_ERROR_STREAM_THROTTLE(
        5.0, "link against link: a cycle failed, and all links are UNKNOWN: " << fault);
    // There may be no memory even for that.
    exception_of([&] { publish_unknown("the last cycle failed: " + fault); });
  }
}

/// Says why nothing is known; empty: the model has no fault.
void SelfProximity::publish_unknown(const std::string& problem,
                                    std::optional<ModelState::Phase> phase) {
  const auto message = boost::make_shared<ProximityArray>();
  ModelState model = model_ ? *model_ : ModelState();
  model.problem = problem;
  if (phase) model.phase = *phase;
  CycleReport report;  // nobody reads it
  fill_without_model(model, node_.config, std::max(ros::Time::now(), last_stamp_), {},
                     message.get(), &report);
  last_stamp_ = message->header.stamp;
  publish(message);
}

void SelfProximity::take_model() {
  const auto newest = node_.loader.state();
  if (newest == loaded_) return;
  const bool is_refined = query_ && is_refinement(*loaded_, *newest);
  model_ = with_paired(newest);
  loaded_ = newest;
  if (is_refined) {
    query_ = std::make_unique<SelfQuery>(model_->robot, query_->pairs(), node_.config.query,
                                         is_stopped_);
    return;
  }
  query_.reset();
  if (!model_->is_ready() || !model_->kinematics) return;  // pairs need all links
  if (!model_->rules_problem.empty()) return;
  publish_unknown("the pairs of links are being chosen", ModelState::Phase::kPacking);
  query_ =
      std::make_unique<SelfQuery>(model_->robot, watched_pairs(), node_.config.query, is_stopped_);
  pose_source_ = make_pose_source(*model_, node_.config, node_.buffer, node_.joints,
                                  JointStateListener::Which::kNewest);
  speeds_.assign(model_->robot->links.size(), ClosingSpeed());
  boxes_ = link_boxes(*model_->robot);
  late_joints_.emplace(model_->kinematics, boxes_);
}

std::vector<LinkPair> SelfProximity::watched_pairs() const {
  const PairChoice choice = choose_pairs(model_, is_stopped_);
  ROS_INFO_STREAM(choice.text(*model_->robot));
  return choice.watched();
}

/// Finds the nearest other link; the answer is UNKNOWN if that of any pair is.
LinkProximity SelfProximity::nearest(std::size_t link, std::size_t* other) const {
  LinkProximity answer;
  if (!poses_.known[link]) return answer;
  answer.state = LinkState::kClear;
  answer.distance = std::numeric_limits<double>::infinity();
  answer.lower_bound = node_.config.query.max_distance;
  answer.margin = margin_;
  for (std::size_t i = 0; i < results_.size(); ++i) {
    const LinkPair& pair = query_->pairs()[i];
    if (pair.first != link && pair.second != link) continue;
    const PairProximity& result = results_[i];
    if (result.state == LinkState::kUnknown) return LinkProximity();
    const double lower_bound = std::min(answer.lower_bound, result.lower_bound);
    if (result.distance < answer.distance) {
      const bool is_first = pair.first == link;
      *other = is_first ? pair.second : pair.first;
      answer.state = result.state;
      answer.distance = result.distance;
      answer.p_FCl = is_first ? result.p_FCa : result.p_FCb;
      answer.p_FCo = is_first ? result.p_FCb : result.p_FCa;
      answer.p_LCl = poses_.X_FL[link].inverse() * answer.p_FCl;
      answer.direction = is_first ? result.direction : Eigen::Vector3d(-result.direction);
    }
    answer.lower_bound = lower_bound;
  }
  return answer;
}

/// Whether no deadline passed before the pairs of a link met the tolerance.
bool SelfProximity::is_finished(std::size_t link) const {
  for (std::size_t i = 0; i < results_.size(); ++i) {
    const LinkPair& pair = query_->pairs()[i];
    if ((pair.first == link || pair.second == link) && !results_[i].finished) return false;
  }
  return true;
}

/// A wrench is unknown where the time ends before all of the volume is summed.
void SelfProximity::compute_wrenches(const LiveConfig& live, TimePoint end, DeadlineCost* cost) {
  const RobotModel& robot = *model_->robot;
  wrenches_.assign(results_.size(), Wrench::zero());
  for (std::size_t i = 0; i < results_.size(); ++i) {
    if (results_[i].state != LinkState::kContact) continue;
    const LinkPair& pair = query_->pairs()[i];
    for (const std::size_t link : {pair.first, pair.second}) model_->usage->note_near(link);
    const ContactGeometry* first = find_contact_geometry(live.contacts.get(), robot, pair.first);
    const ContactGeometry* second = find_contact_geometry(live.contacts.get(), robot, pair.second);
    const Eigen::Isometry3d& X_FA = poses_.X_FL[pair.first];
    wrenches_[i] = Wrench::unknown();
    if (first == nullptr || second == nullptr) continue;
    const ContactVolume volume =
        contact_volume(*first, *second, X_FA.inverse() * poses_.X_FL[pair.second], end);
    cost->least_known = std::min(cost->least_known, volume.known);
    if (volume.known < 1.0) {
      ++cost->no_penetration;
    } else {
      wrenches_[i] = contact_wrench(volume, X_FA, PenetrationConfig());
    }
  }
}

/// Sums the wrenches of all links that touch this one.
Wrench SelfProximity::penetration(std::size_t link, const LinkProximity& answer) const {
  if (answer.state == LinkState::kUnknown) return Wrench::unknown();
  Wrench all = Wrench::zero();
  for (std::size_t i = 0; i < results_.size(); ++i) {
    const LinkPair& pair = query_->pairs()[i];
    if (pair.first == link) all += wrenches_[i];
    if (pair.second != link) continue;
    const Eigen::Vector3d p_SecondFirst =
        poses_.X_FL[pair.first].translation() - poses_.X_FL[pair.second].translation();
    all += reaction(wrenches_[i], p_SecondFirst);
  }
  return all;
}

/// Joints that are late may have moved: that comes off the bounds of the pairs that they part.
void SelfProximity::measure(const LiveConfig& live) {
  late_joints_->update(pose_source_.get(), poses_.stamp, poses_.known);
  const std::vector<LinkPair>& pairs = query_->pairs();
  approach_.clear();
  for (const LinkPair& pair : pairs) {
    approach_.push_back(late_joints_->approach(pair.first, pair.second));
  }
  QueryConfig query = live.query;
  if (!pairs.empty()) query.max_distance += *std::max_element(approach_.begin(), approach_.end());
  query_->set_config(query);
  margin_ = query.margin;
  query_->run(poses_.X_FL, poses_.known, &results_);
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    PairProximity& result = results_[i];
    result.lower_bound -= approach_[i];
    if (result.state != LinkState::kClear) continue;
    result.lower_bound = std::min(result.lower_bound, live.query.max_distance);
  }
}

void SelfProximity::publish_once() {
  const ros::Time now = ros::Time::now();
  if (now < last_now_) {
    speeds_.assign(speeds_.size(), ClosingSpeed());
    last_stamp_ = poses_.stamp = ros::Time();
  }
  last_now_ = now;
  if (!query_) {
    if (!model_->problem.empty()) return publish_unknown(model_->problem);
    return publish_unknown(model_->kinematics ? model_->rules_problem : no_kinematics(*model_));
  }
  const auto message = boost::make_shared<ProximityArray>();
  LiveConfig live = node_.live();
  live.query.deadline = deadline_of(live.query.deadline, 1.0 / SelfCollisionConfig::kRate);
  StatusInput input;
  input.clock_runs = !now.isZero();
  input.findings = model_findings(*model_);
  poses_.stamp = last_stamp_;
  pose_source_->look_up(now, &poses_);
  const auto begin = Clock::now();
  measure(live);
  for (const std::size_t i : model_->monitored) input.deadline.unfinished += is_finished(i) ? 0 : 1;
  message->unfinished = static_cast<std::uint32_t>(input.deadline.unfinished);
  compute_wrenches(live, end_of(live.query.deadline, 1.0, begin), &input.deadline);
  message->header.frame_id = fixed_frame_of(*model_, node_.config);
  message->header.stamp = last_stamp_ = poses_.stamp;
  const RobotModel& robot = *model_->robot;
  note(Rank::kPose, "pose", missing_poses(robot, model_->monitored, poses_, pose_source_.get()),
       &input.findings);
  for (const std::size_t i : model_->monitored) add_link(i, live.repulsion, message.get());
  for (std::size_t i = 0; i < results_.size(); ++i) {
    message->pairs.push_back(pair_message(robot, query_->pairs()[i], results_[i]));
  }
  const std::chrono::duration<double> took = Clock::now() - begin;
  message->computation_time = took.count();
  note(Rank::kDegraded, "pose", poses_.doubts, &input.findings);
  const Status status = decide(find_all(input, now.toSec()), input.clock_runs);
  message->status = status.code;
  message->status_text = status.text;
  publish(message);
}

void SelfProximity::add_link(std::size_t link, const RepulsionConfig& repulsion,
                             ProximityArray* message) {
  std::size_t other = link;
  const LinkProximity answer = nearest(link, &other);
  const RobotModel& robot = *model_->robot;
  const RepulsiveWrench push =
      poses_.known[link]
          ? self_repulsion(link, poses_.X_FL[link], query_->pairs(), results_, repulsion)
          : RepulsiveWrench::unknown();
  // Both links move, so the speed has no parts.
  const ClosingRates closing = speeds_[link].update_pair(poses_.stamp.toSec(), answer);
  message->links.emplace_back();
  assign_link(robot.links[link].name, answer, push, penetration(link, answer), closing,
              robot.links[other].name, &message->links.back());
  assign_box(boxes_[link].box_L, &message->links.back());
}

}  // namespace ist
