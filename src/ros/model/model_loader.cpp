#include "ros/model/model_loader.h"

#include <ros/console.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <set>

#include "internal/robot/mesh_size.h"
#include "ist_proximity/geometry/error.h"
#include "ist_proximity/robot/robot_description.h"
#include "ros/common/exceptions.h"
#include "ros/common/memory.h"
#include "ros/common/text.h"

namespace ist {
namespace {

constexpr std::chrono::milliseconds kPoll(500);
// [s] Between two lines of the log; links from the cache are done before the first one.
constexpr double kLogPeriod = 3.0;

std::string sentence_of(const ModelProgress& progress) {
  return "packing link '" + progress.link + "' (" + std::to_string(progress.index + 1) + " of " +
         std::to_string(progress.count) +
         format_text("), %.0f %% of the robot done", std::floor(100.0 * progress.fraction));
}

}  // namespace

ModelLoader::ModelLoader(const ServerConfig& config, const ros::NodeHandle& nh)
    : config_(config), nh_(nh) {
  ModelState waiting;
  waiting.problem = waiting_for_description();
  set_state(std::move(waiting));
  refining_thread_.start(
      "ist packing", [this] { refine(); }, true);
}

std::shared_ptr<const ModelState> ModelLoader::state() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return state_;
}

void ModelLoader::set_state(ModelState state) {
  if (state.phase == ModelState::Phase::kReading) {
    // Until the URDF is read, the links of the last one are told, as UNKNOWN.
    const auto before = this->state();
    state.links = before->links;
    state.root_link = before->root_link;
  }
  auto shared = std::make_shared<const ModelState>(std::move(state));
  const std::lock_guard<std::mutex> lock(mutex_);
  // After reload() the states of the interrupted load must not appear.
  if (!reload_) state_ = std::move(shared);
}

std::string ModelLoader::reload(bool* found) {
  std::string urdf, problem;
  *found = fetch_urdf(&urdf, &problem);
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    auto state = std::make_shared<ModelState>(*state_);
    state->phase = *found ? ModelState::Phase::kReading : ModelState::Phase::kWaiting;
    state->problem = "the robot's model is being loaded again";
    state->fraction = 0.0;
    state->robot = nullptr;
    state->anytime = nullptr;
    state->repulsion = nullptr;
    state->monitored.clear();
    state->paired.clear();
    state_ = std::move(state);
    reload_ = true;
  }
  return *found ? "reading '" + nh_.resolveName(config_.robot_description) + "' again" : problem;
}

void ModelLoader::load_when_due() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    const bool is_due = reload_ || (state_->phase != ModelState::Phase::kReady &&
                                    std::chrono::steady_clock::now() >= next_load_);
    if (!is_due || stop_) return;
    if (reload_) rejected_.clear();
    reload_ = false;
  }
  const std::string fault = exception_of([this] { load_once(); });
  if (!fault.empty()) fail(fault);
  next_load_ = std::chrono::steady_clock::now() + kPoll;
}

/// Says that an exception has ended the loading; the next round tries again.
void ModelLoader::fail(const std::string& fault) {
  exception_of([&] {  // there may be no memory even for that
    ModelState state;
    state.phase = ModelState::Phase::kFailed;
    state.problem = "the robot's model cannot be loaded: " + fault;
    ROS_ERROR_STREAM_THROTTLE(5.0, state.problem);
    set_state(std::move(state));
  });
}

std::string ModelLoader::waiting_for_description() const {
  return "waiting for the parameter '" + nh_.resolveName(config_.robot_description) +
         "' with the robot's URDF";
}

/// Searches the parameter upwards from the node's namespace, as robot_state_publisher does.
bool ModelLoader::fetch_urdf(std::string* urdf, std::string* problem) const {
  const std::string& name = config_.robot_description;
  std::string key = nh_.resolveName(name);
  nh_.searchParam(name, key);
  XmlRpc::XmlRpcValue value;
  if (!nh_.getParam(key, value)) {
    *problem = waiting_for_description();
    return false;
  }
  if (value.getType() != XmlRpc::XmlRpcValue::TypeString) {
    *problem = "the parameter '" + key + "' is no string; it must hold the robot's URDF";
    return false;
  }
  *urdf = static_cast<std::string&>(value);
  return true;
}

void ModelLoader::load_once() {
  std::string urdf;
  ModelState state;
  if (!fetch_urdf(&urdf, &state.problem)) {
    ROS_WARN_STREAM_THROTTLE(5.0, state.problem);
    rejected_.clear();
    set_state(std::move(state));
    return;
  }
  if (!rejected_.empty() && urdf == rejected_) return;
  try {
    load(urdf);
  } catch (const std::exception& error) {  // ModelError, or no memory
    if (cancelled()) return;
    rejected_ = urdf;
    state.phase = ModelState::Phase::kFailed;
    state.problem = std::string("the robot's URDF in '") + config_.robot_description +
                    "' cannot be used: " + error.what() +
                    "; set it again, it is read whenever it changes";
    ROS_ERROR_STREAM(state.problem);
    set_state(std::move(state));
  }
}

/// Reads the SRDF beside the URDF, where there is one.
void ModelLoader::read_rules(ModelState* state) {
  std::string key;
  XmlRpc::XmlRpcValue value;
  if (!nh_.searchParam(config_.robot_description + "_semantic", key) || !nh_.getParam(key, value)) {
    return;
  }
  state->problem = "reading the SRDF in '" + key + "'";
  set_state(*state);
  try {
    if (value.getType() != XmlRpc::XmlRpcValue::TypeString) throw ModelError("it is no string");
    const std::string& srdf = static_cast<std::string&>(value);
    state->rules = std::make_shared<const CollisionRules>(
        read_srdf(srdf, state->kinematics.get(), [this] { return cancelled(); }));
    for (const std::string& doubt : state->rules->doubts) {
      state->warnings.push_back("'" + key + "': " + doubt);
    }
  } catch (const ModelError& error) {
    // It may enable pairs that are left out without it.
    state->rules_problem = "the SRDF in '" + key + "' cannot be used: " + error.what() +
                           "; mend it or delete it, then call ~reload_model";
    state->warnings.push_back(state->rules_problem);
  }
}

/// Chooses what the links are used for.
void ModelLoader::choose(ModelState* state) const {
  const RobotDescription& description = *state->description;
  std::vector<CoarseHull> hulls;
  if (state->kinematics) hulls = coarse_hulls(description, [this] { return cancelled(); });
  state->choice = choose_links(description, *state->rules, hulls, config_);
  state->links = state->choice.monitored;
  for (const std::string& text : state->choice.warnings) state->warnings.push_back(text);
  if (!state->choice.remarks.empty()) ROS_INFO_STREAM(state->choice.remarks);
}

/// The configuration of the links that anything is asked of.
RobotModelConfig ModelLoader::model_config(const ModelState& state) const {
  RobotModelConfig config = config_.model;
  config.links = state.choice.packed();
  for (const AttachedObject& object : state.objects) add_name(object.link, &config.links);
  return config;
}

/// Completes a state whose robot is built, or a part of it.
void ModelLoader::take_robot(const AnytimeModel::Ptr& made, ModelState* state) {
  state->anytime = made;
  state->robot = made->robot();
  // What carries an attached object is monitored, and the object is a part of the robot.
  LinkChoice choice = state->choice;
  for (const AttachedObject& object : state->objects) {
    add_name(object.link, &choice.monitored);
    add_name(object.link, &choice.filtering);
  }
  const std::set<std::string> monitored(choice.monitored.begin(), choice.monitored.end());
  const std::set<std::string> paired(choice.paired.begin(), choice.paired.end());
  const std::set<std::string> filtering(choice.filtering.begin(), choice.filtering.end());
  state->links.clear();
  state->monitored.clear();
  state->paired.clear();
  state->filters.clear();
  for (std::size_t i = 0; i < state->robot->links.size(); ++i) {
    const std::string& name = state->robot->links[i].name;
    state->filters.push_back(filtering.count(name) > 0);
    if (monitored.count(name) > 0) {
      state->monitored.push_back(i);
      state->links.push_back(name);
    } else if (paired.count(name) > 0) {
      state->paired.push_back(i);
    }
  }
  if (!state->usage || state->usage->size() != state->robot->links.size()) {
    state->usage = std::make_shared<LinkUsage>(state->robot->links.size());
  }
  state->repulsion = nullptr;
}

void ModelLoader::finish(const RobotDescription& description, ModelState* state) const {
  state->phase = ModelState::Phase::kReady;
  state->problem = state->links.empty() ? "no link of the robot '" + description.name +
                                              "' has geometry: nothing can be measured"
                                        : "";
  state->fraction = 1.0;
}

/// Adds the attached objects to the description; objects whose link is gone are dropped.
RobotDescription ModelLoader::carry_over_objects(ModelState* state) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    state->objects = objects_;
  }
  RobotDescription carrying = *state->description;
  std::vector<AttachedObject> kept;
  for (const AttachedObject& object : state->objects) {
    try {
      carrying = with_objects(carrying, {object});
      kept.push_back(object);
    } catch (const ModelError& error) {
      state->warnings.push_back(std::string("no longer attached: ") + error.what());
    }
  }
  state->objects = kept;
  const std::lock_guard<std::mutex> lock(mutex_);
  objects_ = std::move(kept);
  return carrying;
}

void ModelLoader::load(const std::string& urdf) {
  ModelState state;
  state.phase = ModelState::Phase::kReading;
  state.problem = "reading the URDF in '" + config_.robot_description + "'";
  set_state(state);
  state.description = std::make_shared<const RobotDescription>(
      parse_urdf(urdf, config_.geometry, environment_package_finder(),
                 [this](const std::string& link, const std::string& mesh) {
                   return show_reading(link, mesh);
                 }));
  try {
    state.kinematics = std::make_shared<const Kinematics>(*state.description);
  } catch (const ModelError& error) {
    state.kinematics_problem = error.what();
    ROS_WARN_STREAM("link poses cannot be computed from joint states: " << error.what());
  }
  read_rules(&state);
  choose(&state);
  auto carrying = std::make_shared<const RobotDescription>(carry_over_objects(&state));
  if (state.objects.empty()) carrying = state.description;  // the same meshes once
  const RobotDescription& description = *carrying;

  state.phase = ModelState::Phase::kPacking;
  state.problem = "packing of the robot '" + description.name + "' begins";
  state.root_link = description.root_link;
  for (std::string& doubt : doubtful_sizes(description, model_config(state).links)) {
    state.warnings.push_back(std::move(doubt));
  }
  const std::string no_limits = doubtful_limits(description);
  if (!no_limits.empty()) state.warnings.push_back(no_limits);
  for (const std::string& doubt : state.warnings) ROS_WARN_STREAM(doubt);
  set_state(state);

  const auto begin = std::chrono::steady_clock::now();
  if (!build(carrying, &state)) return;  // cancelled
  finish(description, &state);
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  const auto coarse = std::count_if(state.robot->links.begin(), state.robot->links.end(),
                                    [](const LinkModel& link) { return !link.is_final; });
  ROS_INFO("model of '%s' ready after %.2f s: %s; %zu packed coarsely so far",
           description.name.c_str(), took.count(), link_counts(state).c_str(),
           static_cast<std::size_t>(coarse));
  set_state(std::move(state));
  return_free_memory();  // of the meshes' text and of packing: megabytes
}

/// Shows which mesh is being read: a large one, or one on a slow disk, takes long.
/// @returns false when reading has to stop
bool ModelLoader::show_reading(const std::string& link, const std::string& mesh) {
  ModelState state;
  state.phase = ModelState::Phase::kReading;
  state.problem = "reading mesh '" + mesh + "' of link '" + link + "'";
  if (state.problem != this->state()->problem) set_state(std::move(state));
  return !cancelled();
}

/// Packs the links coarsely, or takes them from the cache, and reports the progress.
/// @returns false when cancelled
bool ModelLoader::build(const std::shared_ptr<const RobotDescription>& description,
                        ModelState* state) {
  std::mutex report_mutex;  // several threads pack
  RobotModelCallbacks callbacks;
  callbacks.cancelled = [this] { return cancelled(); };
  callbacks.warning = [&](const std::string& warning) {
    const std::lock_guard<std::mutex> lock(report_mutex);
    std::vector<std::string>& told = state->warnings;
    if (std::find(told.begin(), told.end(), warning) != told.end()) return;  // by another group
    ROS_WARN_STREAM(warning);
    told.push_back(warning);
  };
  callbacks.progress = [&](const ModelProgress& progress) {
    const std::lock_guard<std::mutex> lock(report_mutex);
    state->fraction = progress.fraction;
    const std::string sentence = sentence_of(progress);
    ROS_INFO_STREAM_DELAYED_THROTTLE(kLogPeriod, sentence);
    if (sentence == state->problem) return;  // a new state is work for all parts of the node
    state->problem = sentence;
    set_state(*state);
  };
  // Links answer as they get ready.
  const auto partial = [&](const AnytimeModel::Ptr& made) {
    const std::lock_guard<std::mutex> lock(report_mutex);
    take_robot(made, state);
    set_state(*state);
  };
  const AnytimeModel::Ptr made = AnytimeModel::build(
      description, model_config(*state), AnytimeModel::Stage::kFirst, callbacks, partial);
  if (!made) return false;
  take_robot(made, state);
  return true;
}

}  // namespace ist
