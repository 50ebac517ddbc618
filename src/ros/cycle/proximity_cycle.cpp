#include "ros/cycle/proximity_cycle.h"

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <utility>

#include "internal/proximity/deadline.h"
#include "ist_proximity/repulsion/object_repulsion.h"
#include "ros/common/ros_time.h"
#include "ros/common/stopwatch.h"
#include "ros/cycle/cycle_message.h"
#include "ros/output/message_conversion.h"

namespace ist {

using ist_proximity::ProximityArray;

namespace {

constexpr double kLeastDeadline = 1e-9;  // [s] 0 would be none

constexpr char kOutsideRegion[] =
    "a link is near places where points were dropped as outside the region of interest: obstacles "
    "there are not known; it is farther out than the limits of prismatic joints allow (state the "
    "true ones in the URDF), or a memory was made for a smaller robot or ~query/margin";

}  // namespace

ProximityCycle::ProximityCycle(std::shared_ptr<const ModelState> model, const ServerConfig& config,
                               std::unique_ptr<PoseSource> poses, CloudSelection::Reader reader,
                               std::vector<std::unique_ptr<AddOnCycle>> add_ons)
    : model_(std::move(model)),
      packed_(model_->robot),
      robot_(*model_->robot),
      boxes_(link_boxes(robot_)),
      fixed_frame_(fixed_frame_of(*model_, config)),
      pose_source_(std::move(poses)),
      pose_timeout_(config.pose_timeout),
      self_counts_(config.self_collision.enabled && config.self_collision.in_minimum),
      future_(config.deceleration, model_->kinematics, boxes_, model_->monitored),
      selection_(reader),
      queries_(std::make_unique<CoherentQueries>(model_->robot, config.query)),
      add_ons_(std::move(add_ons)),
      filters_(robot_.links.size()),
      speeds_(robot_.links.size()),
      joint_repulsion_(*model_),
      wanted_(wanted_links(*model_)),
      measurable_(wanted_),
      late_joints_(model_->kinematics, boxes_),
      late_worlds_(robot_, poses_.X_FL, known_),
      late_maps_(robot_, poses_.X_FL, known_),
      results_(robot_.links.size()),
      pushes_(robot_.links.size(), RepulsiveWrench::unknown()),
      wrenches_(robot_.links.size(), Wrench::unknown()) {
  set_problem(*model_);
}

void ProximityCycle::run(const ros::Time& now, const CloudSources& sources,
                         const LiveConfig& config, const std::string& transform_problem,
                         ProximityArray* message) {
  Stopwatch watch;
  now_ = now;
  deadline_ = config.query.deadline;
  look_up_poses(now);
  message->poses_time = watch.lap();
  const TimePoint begin = Stopwatch::Clock::now();
  status_input_.deadline = DeadlineCost();
  status_input_.findings = model_findings_;
  SnapshotRequest& request = asked_.request;
  request.model = model_->robot;
  request.time = poses_.stamp;
  request.max_age = pose_timeout_;
  if (pose_source_) request.root = pose_source_->newest_root(&request.X_FR);
  selection_.update(now, sources, request, &status_input_);
  if (!request.root.empty()) pose_source_->look_up_joints_again(now, &poses_);
  take_warm_queries();
  describe_pose_problems(transform_problem);
  const double preparation = watch.lap();

  run_query(config, begin);
  note_asked(config);
  run_add_ons(config);
  message->query_time = watch.lap();
  find_urgent_links();
  compute_pushes(config, end_of(deadline_, kRepulsionShare, begin));
  message->repulsion_time = watch.lap();
  const TimePoint end = end_of(deadline_, 1.0, begin);
  for (const std::size_t i : urgent_) wrenches_[i] = penetration(i, config, end);
  message->penetration_time = watch.lap();

  message->header.stamp = poses_.stamp;
  message->header.frame_id = fixed_frame_;
  message->cloud_stamp = selection_.oldest_stamp();
  message->unfinished = static_cast<std::uint32_t>(status_input_.deadline.unfinished);
  fill_links(message);
  selection_.list_zones(&message->zones);
  findings_ = find_all(status_input_, now.toSec());
  status_ = decide(findings_, status_input_.clock_runs);
  fill_status(status_input_, status_, message);
  message->message_time = preparation + watch.lap();
  message->computation_time = message->query_time + message->repulsion_time +
                              message->penetration_time + message->message_time;
}

void ProximityCycle::report(const ProximityArray& message, CycleReport* report) const {
  report->take(status_input_, findings_, status_);
  report->links_monitored = model_->monitored.size();
  report->links_known = poses_.count_known();
  report->pose_age = seconds_between(poses_.stamp, now_);
  report->deadline = deadline_;
  // The spare queries of a warm-up take as much.
  report->query_memory = queries_->query().memory() * (has_spare_ ? 2 : 1);
  report->add_times(message);
  if (status_input_.deadline.any()) ++report->deadlines_missed;
  report->worst_deadline.add(status_input_.deadline);
}

void ProximityCycle::set_problem(const ModelState& model) {
  status_input_.has_model = model.problem.empty();
  model_findings_ = model_findings(model);
  note(Rank::kDegraded, "model", future_.problem(), &model_findings_);
}

void ProximityCycle::set_warm_up(SceneWarmUp* warm_up) {
  if (warm_up == nullptr && warm_up_ != nullptr) {
    asked_.sources.clear();  // no source has a part
    warm_up_->note(asked_);
  }
  warm_up_ = warm_up;
  if (warm_up == nullptr || has_spare_) return;
  warm_up->begin(std::make_unique<CoherentQueries>(packed_, queries_->query().config(),
                                                   queries_->repulsion()));
  has_spare_ = true;
}

/// Goes on from the first answer that another thread made with the clouds that are new.
void ProximityCycle::take_warm_queries() {
  if (warm_up_ == nullptr) return;
  const std::uint64_t obstacles = obstacles_key(selection_.clouds());
  if (std::exchange(last_obstacles_, obstacles) == obstacles) return;
  const Repulsion repulsion = queries_->repulsion();
  if (!warm_up_->exchange(obstacles, &queries_)) return;
  if (queries_->model() != packed_) queries_->set_model(packed_, repulsion);
}

void ProximityCycle::note_asked(const LiveConfig& config) {
  if (warm_up_ == nullptr) return;
  asked_.sources = selection_.cloud_sources();
  asked_.sources.erase(std::unique(asked_.sources.begin(), asked_.sources.end()),
                       asked_.sources.end());
  asked_.X_FL = poses_.X_FL;
  asked_.known = known_;
  asked_.query = config.query;
  asked_.repulsion = config.repulsion;
  warm_up_->note(asked_);
}

void ProximityCycle::run_query(const LiveConfig& config, TimePoint begin) {
  QueryConfig query = config.query;
  measurable_ = wanted_;
  selection_.exclude_unfiltered(&measurable_);
  known_ = measurable_;
  for (std::size_t i = 0; i < known_.size(); ++i) known_[i] = known_[i] && poses_.known[i];
  place_carried_objects();
  note_late_frames();
  // The world is known exactly and costs little: it may take half of the time.
  worlds_.run(poses_.X_FL, known_, selection_, query, config.repulsion.influence_distance,
              poses_.stamp.toSec(), end_of(query.deadline, 0.5 * kQueryShare, begin), &late_worlds_,
              &status_input_.deadline);
  if (query.deadline > 0.0) {
    const std::chrono::duration<double> left =
        end_of(query.deadline, kQueryShare, begin) - Stopwatch::Clock::now();
    query.deadline = std::max(left.count(), kLeastDeadline);
  }
  ProximityQuery& clouds = queries_->query();
  const double max_distance = query.max_distance;
  query.max_distance = late_maps_.range(max_distance);
  clouds.set_config(query);
  clouds.run(poses_.X_FL, known_, selection_.clouds(), &results_);
  const QueryStatistics& statistics = clouds.statistics();
  if (statistics.outside_region > 0) {
    note(Rank::kDegraded, "query", kOutsideRegion, &status_input_.findings);
  }
  status_input_.deadline.unfinished += statistics.unfinished;
  status_input_.deadline.widest = std::max(status_input_.deadline.widest, statistics.widest);
  late_maps_.lower(max_distance, &results_);
  for (const LateFrames* late : {&late_worlds_, &late_maps_}) {
    note(Rank::kDegraded, "pose", late->doubt(query.tolerance), &status_input_.findings);
  }
  if (worlds_.any()) cloud_results_ = results_;
  worlds_.combine(selection_.clouds(), &results_);
  note_usage(config);
}

/// Finds the frames of worlds and maps whose poses are older than the links'.
void ProximityCycle::note_late_frames() {
  late_worlds_.begin();
  late_maps_.begin();
  const bool is_stated = pose_source_ && pose_source_->is_stated();
  const auto is_carried = [&](const std::string& frame) {
    const auto is_it = [&](const CarriedWorlds::Frame& one) {
      return model_->kinematics->bodies()[one.body] == frame;
    };
    return is_stated && std::any_of(carried_.frames().begin(), carried_.frames().end(), is_it);
  };
  for (const SourceSnapshot* source : selection_.selected()) {
    if (!source) continue;
    const std::size_t objects = source->surfaces ? source->world.X_FB.size() : 0;
    for (std::size_t i = 0; i < source->lags.size(); ++i) {
      for (const Lag& lag : source->lags[i]) {
        // Objects that the robot carries move with the configuration that is stated; maps stay.
        if (i < objects && is_carried(lag.frame)) continue;
        (i < objects ? late_worlds_ : late_maps_).add(lag);
      }
    }
  }
  const Span<const double> moved =
      late_joints_.update(pose_source_.get(), poses_.stamp, poses_.known);
  late_worlds_.set_links(moved);
  late_maps_.set_links(moved);
}

/// In a configuration that the robot is not in, the objects that it carries are elsewhere, too.
void ProximityCycle::place_carried_objects() {
  if (!pose_source_ || !pose_source_->is_stated() || selection_.worlds().empty()) return;
  carried_.take(selection_.worlds(), *model_->kinematics);
  if (carried_.frames().empty()) return;
  BodyPoses bodies;
  pose_source_->look_up_all(*model_->kinematics, poses_.stamp, &bodies);
  carried_.place(bodies);
  selection_.set_worlds(carried_.worlds());
}

void ProximityCycle::run_add_ons(const LiveConfig& config) {
  for (const std::unique_ptr<AddOnCycle>& add_on : add_ons_) {
    note(Rank::kDegraded, "query", add_on->run(poses_, known_, fixed_frame_, config),
         &status_input_.findings);
  }
}

/// The links that matter most are served first, as time may end.
void ProximityCycle::find_urgent_links() {
  urgent_.assign(model_->monitored.begin(), model_->monitored.end());
  std::sort(urgent_.begin(), urgent_.end(), [this](std::size_t a, std::size_t b) {
    return results_[a].lower_bound < results_[b].lower_bound;
  });
}

void ProximityCycle::compute_pushes(const LiveConfig& config, TimePoint end) {
  const std::uint64_t obstacles = obstacles_key(selection_.clouds()) ^ worlds_.key();
  for (const std::size_t i : urgent_) {
    const Eigen::Isometry3d& X_FL = poses_.X_FL[i];
    std::uint64_t key = obstacles;
    RepulsiveWrench raw;
    if (!worlds_.any()) {
      raw = queries_->repel(i, X_FL, selection_.clouds(), results_[i], config.repulsion, end);
    } else {
      LinkProximity clouds;
      clouds.state = LinkState::kClear;
      if (!selection_.clouds().empty()) {
        clouds = cloud_results_[i];
        raw = queries_->repel(i, X_FL, selection_.clouds(), clouds, config.repulsion, end);
      }
      raw = with_objects(X_FL, raw, clouds, worlds_.near_objects(i), results_[i], config.repulsion);
      // Objects that were not measured in time come and go: the filter spreads the change.
      if (!worlds_.is_finished(i)) key ^= ++partial_;
    }
    if (results_[i].state != LinkState::kUnknown && !raw.force.allFinite()) {
      ++status_input_.deadline.unblended;  // the filter holds the last one
    }
    pushes_[i] =
        filters_[i].update(poses_.stamp.toSec(), key, raw, results_[i], config.repulsion, X_FL);
  }
}

void ProximityCycle::look_up_poses(const ros::Time& now) {
  if (pose_source_) {
    pose_source_->look_up(now, &poses_);
  } else {
    poses_.reset(now, robot_.links.size());
    poses_.set_problem(wanted_, {no_kinematics(*model_), false});
  }
  status_input_.clock_runs = !now.isZero();
}

void ProximityCycle::describe_pose_problems(const std::string& transform_problem) {
  std::vector<std::string> problems =
      missing_poses(robot_, model_->monitored, poses_, pose_source_.get());
  for (std::size_t i = 0; i < selection_.selected().size(); ++i) {
    const SourceSnapshot* snapshot = selection_.selected()[i];
    if (!snapshot) continue;
    const std::string unfiltered =
        unfiltered_links(robot_, model_->monitored, poses_, pose_source_.get(), *snapshot,
                         status_input_.sources[i].name);
    if (!unfiltered.empty()) problems.push_back(unfiltered);
  }
  const bool is_new = std::none_of(problems.begin(), problems.end(), [&](const std::string& text) {
    return text.find(transform_problem) != std::string::npos;
  });
  if (!problems.empty() && is_new) problems.push_back(transform_problem);
  note(Rank::kPose, "pose", problems, &status_input_.findings);
  note(Rank::kDegraded, "pose", poses_.doubts, &status_input_.findings);
}

void ProximityCycle::fill_links(ProximityArray* message) {
  const std::string nowhere;
  if (future_.is_stated()) future_.update(pose_source_.get(), poses_.stamp);
  const Span<const double> moved = late_joints_.moved();
  message->links.resize(model_->monitored.size());
  for (std::size_t k = 0; k < message->links.size(); ++k) {
    const std::size_t i = model_->monitored[k];
    const LinkProximity& result = results_[i];
    const bool is_world = worlds_.any() && worlds_.is_nearest(i);
    const int source = selection_.source_of(result, is_world);
    assign_link(robot_.links[i].name, result, pushes_[i], wrenches_[i],
                speeds_[i].update(message->header.stamp.toSec(), result, poses_.X_FL[i],
                                  is_world ? worlds_.nearest(result, source)
                                           : selection_.nearest(result, source)),
                source < 0 ? nowhere : status_input_.sources[static_cast<std::size_t>(source)].name,
                &message->links[k]);
    assign_box(boxes_[i].box_L, &message->links[k]);
    const double late = moved.empty() ? 0.0 : moved[i];
    for (std::size_t n = 0; n < add_ons_.size() && result.state != LinkState::kUnknown; ++n) {
      add_ons_[n]->fill(i, late, &message->links[k]);
    }
    message->links[k].robot_future = future_.left_of(k, message->links[k].lower_bound);
  }
}

/// The wrench is unknown in contact until the link's contact body is packed, and where the deadline
/// passes before all of the volume is summed.
Wrench ProximityCycle::penetration(std::size_t link, const LiveConfig& config, TimePoint end) {
  const LinkProximity& result = results_[link];
  // The volume that a link shares with an object is not computed.
  if (worlds_.is_in_contact(link)) return Wrench::unknown();
  const ContactGeometry* body = find_contact_geometry(config.contacts.get(), robot_, link);
  ContactVolume volume;
  const bool is_known = result.state == LinkState::kContact && body != nullptr;
  if (is_known) {
    volume = contact_volume(packed_->links[link], *body, poses_.X_FL[link],
                            queries_->clouds_for(link, selection_.clouds()), end);
    DeadlineCost& cost = status_input_.deadline;
    if (volume.known < 1.0) ++cost.no_penetration;
    cost.least_known = std::min(cost.least_known, volume.known);
  }
  return penetration_wrench(result, config.query, is_known ? &volume : nullptr, poses_.X_FL[link],
                            PenetrationConfig());
}

/// Tells the background packing what the links need.
void ProximityCycle::note_usage(const LiveConfig& config) {
  if (!model_->usage) return;
  for (const std::size_t i : model_->monitored) {
    const bool is_near = results_[i].state >= LinkState::kNear &&
                         results_[i].lower_bound < config.repulsion.influence_distance;
    if (is_near) model_->usage->note_near(i);
  }
}

void ProximityCycle::refine(const std::shared_ptr<const ModelState>& model) {
  for (std::size_t i = 0; i < filters_.size(); ++i) {
    if (model->robot->links[i].packing_id != packed_->links[i].packing_id) {
      filters_[i].expect_jump();
    }
  }
  packed_ = model->robot;
  queries_->set_model(packed_, model->repulsion ? *model->repulsion : Repulsion(packed_));
  for (const std::unique_ptr<AddOnCycle>& add_on : add_ons_) add_on->set_model(packed_);
}

void ProximityCycle::forget() {
  speeds_.assign(speeds_.size(), ClosingSpeed());
  filters_.assign(filters_.size(), RepulsionFilter());
  queries_->forget_repulsion();
  poses_.stamp = ros::Time();
}

MarkerScene ProximityCycle::marker_scene() const {
  MarkerScene scene;
  for (std::size_t i = 0; i < packed_->links.size(); ++i) {
    if (i >= poses_.known.size() || !poses_.known[i]) continue;
    for (const InnerSphere& sphere : packed_->links[i].packing.spheres) {
      const Eigen::Vector3d p_FS = poses_.X_FL[i] * sphere.center;
      scene.robot.extend(p_FS - Eigen::Vector3d::Constant(sphere.radius));
      scene.robot.extend(p_FS + Eigen::Vector3d::Constant(sphere.radius));
    }
  }
  for (std::size_t k = 0; k < model_->monitored.size(); ++k) {
    const std::size_t link = model_->monitored[k];
    for (std::size_t n = 0; n < add_ons_.size() && known_[link]; ++n) {
      add_ons_[n]->draw(link, k, &scene);
    }
  }
  return scene;
}

void ProximityCycle::fill_joint_repulsion(const std::string& self_problem,
                                          const ProximityArray* self,
                                          ist_proximity::JointRepulsion* message) {
  all_pushes_ = pushes_;
  for (const std::size_t i : model_->paired) all_pushes_[i] = RepulsiveWrench();
  if (self_counts_) add_self_repulsion(self_problem.empty() ? self : nullptr);
  joint_repulsion_.fill(pose_source_.get(), all_pushes_, message);
  if (!self_counts_ || message->status != ProximityArray::OK) return;
  const bool is_known = self_problem.empty() && self != nullptr;
  if (is_known && self->status == ProximityArray::OK) return;
  message->status = is_known ? self->status : static_cast<std::uint8_t>(ProximityArray::NO_POSE);
  message->status_text = "link against link: " + (is_known ? self->status_text : self_problem);
}

/// @param self  of the monitored links, then of the paired ones; or null: not known
void ProximityCycle::add_self_repulsion(const ProximityArray* self) {
  const std::size_t monitored = model_->monitored.size();
  for (std::size_t i = 0; i < monitored + model_->paired.size(); ++i) {
    RepulsiveWrench& push =
        all_pushes_[i < monitored ? model_->monitored[i] : model_->paired[i - monitored]];
    if (self == nullptr || i >= self->links.size()) {
      push = RepulsiveWrench::unknown();
      continue;
    }
    const auto& own = self->links[i];
    push.force += Eigen::Vector3d(own.repulsion.x, own.repulsion.y, own.repulsion.z);
    push.torque +=
        Eigen::Vector3d(own.repulsion_torque.x, own.repulsion_torque.y, own.repulsion_torque.z);
  }
}

}  // namespace ist
