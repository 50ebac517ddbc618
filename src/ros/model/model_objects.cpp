#include <ros/console.h>

#include <algorithm>
#include <chrono>

#include "internal/geometry/limits.h"
#include "ist_proximity/geometry/error.h"
#include "ros/common/text.h"
#include "ros/model/model_loader.h"

namespace ist {
namespace {

std::string not_ready(const ModelState& state) {
  return "the robot's model is not ready yet: " + state.problem;
}

}  // namespace

void ModelLoader::end_changes() { changes_ended_ = true; }

bool ModelLoader::change_cancelled() const {
  return cancelled() || changes_ended_ || change_revoked_ ||
         std::chrono::steady_clock::now() > change_deadline_;
}

std::string ModelLoader::why_cancelled() const {
  if (stop_ || changes_ended_) return "the node is shutting down";
  if (change_revoked_) return "the object was detached while it was being attached";
  if (reload_) return "the robot's model has been loaded again meanwhile; try again";
  return "it takes longer than " + std::to_string(kMaxAttachTime.count()) +
         " s; use a simpler mesh, a primitive shape, or raise ~packing/max_error";
}

/// Makes `name` the object at work, or none where it is empty.
void ModelLoader::begin_change(const std::string& name) {
  const std::lock_guard<std::mutex> lock(mutex_);
  changing_ = name;
  change_revoked_ = false;
}

std::string ModelLoader::attach(const std::string& name, const ObjectReader& read) {
  const std::lock_guard<std::mutex> lock(change_mutex_);
  begin_change(name);
  change_deadline_ = std::chrono::steady_clock::now() + kMaxAttachTime;
  std::string problem;
  try {
    problem = attach_read(name, read);
  } catch (const Cancelled&) {
    problem = why_cancelled();
  } catch (const std::exception& error) {  // ModelError, or no memory
    problem = error.what();
  }
  begin_change("");
  return problem.empty() ? problem : "object '" + printable(name) + "' is not attached: " + problem;
}

std::string ModelLoader::attach_read(const std::string& name, const ObjectReader& read) {
  const auto state = this->state();
  if (!state->robot) return not_ready(*state);
  if (state->objects.size() >= kMaxObjects) {
    return std::to_string(kMaxObjects) + " objects are attached, which is the limit; detach some";
  }
  for (const AttachedObject& other : state->objects) {
    if (other.name != name) continue;
    return "an object of this name is attached to link '" + other.link +
           "' already; detach it first";
  }
  std::vector<AttachedObject> objects = state->objects;
  objects.push_back(read([this] { return change_cancelled(); }));
  const std::string link = objects.back().link;
  return change_objects(state, std::move(objects), link);
}

std::string ModelLoader::detach(const std::string& name) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!name.empty() && changing_ == name) {  // it has no part in the model yet
      change_revoked_ = true;
      return "";
    }
  }
  const std::lock_guard<std::mutex> lock(change_mutex_);
  begin_change("");
  change_deadline_ = std::chrono::steady_clock::now() + kMaxAttachTime;
  const auto state = this->state();
  if (!state->robot) return not_ready(*state);
  std::vector<AttachedObject> objects = state->objects;
  const auto found = std::find_if(objects.begin(), objects.end(),
                                  [&](const AttachedObject& other) { return other.name == name; });
  if (found == objects.end()) {
    std::vector<std::string> names;
    names.reserve(objects.size());
    for (const AttachedObject& other : objects) names.push_back(other.name);
    return "no object '" + printable(name) + "' is attached; there is " +
           (names.empty() ? "none at all" : join(names, ", "));
  }
  const std::string link = found->link;
  objects.erase(found);
  return change_objects(state, std::move(objects), link);
}

std::string ModelLoader::change_objects(const std::shared_ptr<const ModelState>& state,
                                        std::vector<AttachedObject> objects,
                                        const std::string& link) {
  ModelState next = *state;
  next.objects = std::move(objects);
  RobotModelCallbacks callbacks;
  callbacks.cancelled = [this] { return change_cancelled(); };
  callbacks.warning = [&](const std::string& warning) { ROS_WARN_STREAM(warning); };
  try {
    const auto description =
        std::make_shared<const RobotDescription>(with_objects(*state->description, next.objects));
    next.anytime = state->anytime->with_link(description, link,
                                             model_config(*description, next.objects), callbacks);
    next.robot = next.anytime ? next.anytime->robot() : nullptr;
    if (next.robot) finish(*description, &next);
  } catch (const ModelError& error) {
    return error.what();
  }
  if (next.robot) {
    for (const LinkModel& built : next.robot->links) {
      if (built.name == link && !built.usable()) return built.error;
    }
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!next.robot || stop_ || changes_ended_ || change_revoked_ || reload_) return why_cancelled();
  if (state_ != state) return "the robot's model has been loaded again meanwhile; try again";
  changing_.clear();  // from now on detach() finds it in the model
  objects_ = next.objects;
  state_ = std::make_shared<const ModelState>(std::move(next));
  return "";
}

}  // namespace ist
