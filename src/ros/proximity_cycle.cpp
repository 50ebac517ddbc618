#include "ros/proximity_cycle.h"

#include <algorithm>
#include <chrono>

#include "ros/output/message_conversion.h"
#include "ros/poses/joint_pose_source.h"
#include "ros/poses/tf_pose_source.h"
#include "ros/poses/transforms.h"
#include "ros/ros_time.h"

namespace ist {
namespace {

using ist_proximity::ProximityArray;

void fill_sources(const Situation& situation, ProximityArray* message) {
  message->sources.clear();
  for (std::size_t i = 0; i < situation.sources.size(); ++i) {
    message->sources.push_back(
        to_message(situation.sources[i], situation.verdicts[i], message->header.stamp));
  }
}

void fill_status(const Situation& situation, const ros::Time& now, ProximityArray* message,
                 CycleReport* report) {
  const Verdict verdict = judge(situation, now.toSec());
  message->status = report->status = verdict.status;
  message->status_text = report->text = verdict.text;
  report->sources = situation.sources;
  report->verdicts = situation.verdicts;
  report->pose_problems = situation.pose_problems;
}

}  // namespace

std::vector<std::string> link_names(const RobotModel& robot) {
  std::vector<std::string> names;
  for (const LinkModel& link : robot.links) names.push_back(link.name);
  return names;
}

std::vector<bool> wanted_links(const ModelState& model) {
  std::vector<bool> wanted(model.robot->links.size(), false);
  for (const std::size_t i : model.monitored) wanted[i] = model.robot->links[i].usable();
  return wanted;
}

std::string fixed_frame_of(const ModelState& model, const ServerConfig& config) {
  return config.fixed_frame.empty() ? without_slash(model.root_link) : config.fixed_frame;
}

std::unique_ptr<PoseSource> make_pose_source(const ModelState& model, const ServerConfig& config,
                                             const tf2::BufferCore& buffer,
                                             JointStateListener* joints,
                                             JointPoseSource::Which which) {
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

ProximityCycle::ProximityCycle(std::shared_ptr<const ModelState> model, const ServerConfig& config,
                               std::unique_ptr<PoseSource> poses, Reader reader)
    : model_(std::move(model)),
      robot_(*model_->robot),
      fixed_frame_(fixed_frame_of(*model_, config)),
      pose_source_(std::move(poses)),
      reader_(reader),
      pose_timeout_(config.pose_timeout),
      query_(model_->robot, config.query),
      repulsion_(model_->robot),
      filters_(robot_.links.size()),
      speeds_(robot_.links.size()),
      joint_repulsion_(*model_),
      results_(robot_.links.size()),
      pushes_(robot_.links.size(), RepulsiveWrench::unknown()) {
  situation_.model_problem = model_->problem;
  for (const std::size_t i : model_->monitored) {
    const LinkModel& link = robot_.links[i];
    if (!link.usable()) situation_.link_errors.push_back(link.error);
  }
}

void ProximityCycle::run(const ros::Time& now, const CloudSources& sources,
                         const LiveConfig& config, ProximityArray* message, CycleReport* report) {
  query_.set_config(config.query);
  look_at_poses(now);
  const auto begin = std::chrono::steady_clock::now();
  look_at_sources(now, sources);
  situation_.pose_problems = pose_problems();
  if (!situation_.pose_problems.empty() && !report->transform_problem.empty()) {
    situation_.pose_problems.push_back(report->transform_problem);
  }

  std::vector<bool> known = measurable();
  for (std::size_t i = 0; i < known.size(); ++i) known[i] = known[i] && poses_.known[i];
  situation_.deadline_passed =
      !query_.run(poses_.X_FL, known, clouds_, &results_) && !clouds_.empty();
  situation_.outside_region = query_.statistics().outside_region > 0;

  message->header.stamp = poses_.stamp;
  message->header.frame_id = fixed_frame_;
  fill_links(config, message);
  fill_sources(situation_, message);
  message->cloud_stamp = ros::Time();
  for (std::size_t i = 0; i < snapshots_.size(); ++i) {
    if (clouds_.empty() || !situation_.verdicts[i].ok()) continue;
    const ros::Time& stamp = snapshots_[i]->stamp;
    if (situation_.sources[i].is_file) continue;
    if (message->cloud_stamp.isZero() || stamp < message->cloud_stamp) {
      message->cloud_stamp = stamp;
    }
  }
  fill_status(situation_, now, message, report);
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  message->computation_time = took.count();

  report->links_monitored = model_->monitored.size();
  report->links_known = poses_.count_known();
  report->pose_age = seconds_between(poses_.stamp, now);
  report->times.add(took.count());
  if (situation_.deadline_passed) ++report->deadlines_missed;
}

std::vector<bool> ProximityCycle::measurable() const {
  // A link in tf, but whose own points are still in the cloud, would be found touching itself.
  std::vector<bool> measurable = wanted_links(*model_);
  for (const SourceSnapshot* snapshot : snapshots_) {
    if (!snapshot || clouds_.empty() || snapshot->filtered.empty()) continue;
    for (std::size_t i = 0; i < measurable.size(); ++i) {
      measurable[i] = measurable[i] && snapshot->filtered[i];
    }
  }
  return measurable;
}

void ProximityCycle::look_at_poses(const ros::Time& now) {
  if (pose_source_) {
    pose_source_->look_up(now, &poses_);
  } else {
    poses_.reset(now, robot_.links.size());
    poses_.blame(wanted_links(*model_), "of the URDF, " + model_->kinematics_problem);
  }
  situation_.clock_runs = !now.isZero();
}

/// Takes the newest snapshots and decides which of them the query may see.
void ProximityCycle::look_at_sources(const ros::Time& now, const CloudSources& sources) {
  situation_.sources.clear();
  situation_.verdicts.clear();
  snapshots_.clear();
  held_.clear();
  for (const auto& source : sources) {
    const SourceSnapshot* snapshot;
    if (reader_ == Reader::kOnly) {
      snapshot = source->newest(model_->robot, poses_.stamp, pose_timeout_);
    } else {
      held_.push_back(source->share(model_->robot, poses_.stamp, pose_timeout_));
      snapshot = held_.back().get();
    }
    SourceFacts facts = source->facts();
    if (snapshot) {
      facts.has_snapshot = true;
      facts.stamp = snapshot->stamp;
      facts.counts = snapshot->cloud.counts;
      facts.ingest_time = snapshot->cloud.ingest_time;
    }
    situation_.verdicts.push_back(judge_source(facts, now.toSec()));
    situation_.sources.push_back(std::move(facts));
    snapshots_.push_back(snapshot);
  }

  clouds_.clear();
  cloud_names_.clear();
  const bool usable = clouds_usable(situation_);
  for (std::size_t i = 0; i < snapshots_.size(); ++i) {
    if (!situation_.verdicts[i].ok()) snapshots_[i] = nullptr;
    if (!usable || !snapshots_[i]) continue;
    clouds_.push_back(&snapshots_[i]->cloud);
    cloud_names_.push_back(situation_.sources[i].name);
  }
}

/// One sentence per reason, with every link that it holds for.
std::vector<std::string> ProximityCycle::pose_problems() const {
  std::vector<std::string> sentences;
  std::string others;
  for (const std::size_t i : model_->monitored) {
    if (poses_.problems[i].empty()) continue;
    const std::string name = "'" + robot_.links[i].name + "'";
    if (sentences.empty()) {
      sentences.push_back("link " + name + " has no pose: " + poses_.problems[i] +
                          (pose_source_ ? "; " + pose_source_->hint() : ""));
    } else {
      others += (others.empty() ? "" : ", ") + name;
    }
  }
  if (!others.empty()) sentences.push_back("no pose either for " + others);

  for (std::size_t s = 0; s < snapshots_.size(); ++s) {
    const SourceSnapshot* snapshot = snapshots_[s];
    if (!snapshot || clouds_.empty() || snapshot->filtered.empty()) continue;
    std::string unfiltered;
    for (const std::size_t i : model_->monitored) {
      if (!poses_.known[i] || snapshot->filtered[i]) continue;
      unfiltered += (unfiltered.empty() ? "" : ", ") + ("'" + robot_.links[i].name + "'");
    }
    if (unfiltered.empty()) continue;
    sentences.push_back("no pose at the stamp of the cloud in use from source '" +
                        situation_.sources[s].name +
                        "', so that its own points are still in it: " + unfiltered);
  }
  return sentences;
}

/// The usable cloud that holds the nearest point.
ClosingSpeed::Nearest ProximityCycle::nearest_source(const LinkProximity& result) const {
  const auto source = static_cast<std::size_t>(result.source);
  if (result.source < 0 || source >= clouds_.size()) return {};
  return {cloud_names_[source], obstacles_key({clouds_[source]}), clouds_[source]->stamp};
}

void ProximityCycle::fill_links(const LiveConfig& config, ProximityArray* message) {
  message->links.clear();
  const std::uint64_t obstacles = obstacles_key(clouds_);
  for (const std::size_t i : model_->monitored) {
    const LinkProximity& result = results_[i];
    const Eigen::Isometry3d& X_FL = poses_.X_FL[i];
    const ClosingSpeed::Nearest nearest = nearest_source(result);
    pushes_[i] = filters_[i].update(message->header.stamp.toSec(), obstacles,
                                    repulsion_.wrench(i, X_FL, clouds_, result, config.repulsion),
                                    result, config.repulsion);
    message->links.push_back(to_message(
        robot_.links[i].name, result, pushes_[i], penetration(i, config),
        speeds_[i].update(message->header.stamp, result, X_FL, nearest), nearest.source));
  }
}

/// Not known in contact until the link's disjoint packing is there.
Wrench ProximityCycle::penetration(std::size_t link, const LiveConfig& config) const {
  const LinkProximity& result = results_[link];
  const ContactGeometry* body = find_contact_geometry(config.contacts.get(), robot_, link);
  ContactVolume volume;
  const bool is_known = result.state == LinkState::kContact && body != nullptr;
  if (is_known) volume = contact_volume(robot_.links[link], *body, poses_.X_FL[link], clouds_);
  return penetration_wrench(result, config.query, is_known ? &volume : nullptr, poses_.X_FL[link],
                            config.penetration);
}

void ProximityCycle::forget() {
  speeds_.assign(speeds_.size(), ClosingSpeed());
  filters_.assign(filters_.size(), RepulsionFilter());
}

void ProximityCycle::fill_joint_repulsion(const ProximityArray& proximity,
                                          ist_proximity::JointRepulsion* message) {
  joint_repulsion_.fill(pose_source_.get(), pushes_, proximity, message);
}

void say_no_model(const ModelState& model, const std::string& fixed_frame, const ros::Time& now,
                  const CloudSources& sources, ProximityArray* message, CycleReport* report) {
  Situation situation;
  situation.model_problem = model.problem;
  situation.clock_runs = !now.isZero();
  for (const auto& source : sources) {
    situation.sources.push_back(source->facts());
    situation.verdicts.push_back(judge_source(situation.sources.back(), now.toSec()));
  }
  *message = ProximityArray();
  message->header.stamp = now;
  message->header.frame_id = fixed_frame.empty() ? without_slash(model.root_link) : fixed_frame;
  for (const std::string& link : model.links) message->links.push_back(unknown_link(link));
  fill_sources(situation, message);
  fill_status(situation, now, message, report);
  report->links_monitored = model.links.size();
  report->links_known = 0;
}

}  // namespace ist
