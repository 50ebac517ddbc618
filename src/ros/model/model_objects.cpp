#include <ros/console.h>

#include <algorithm>
#include <chrono>

#include "internal/geometry/limits.h"
#include "ist_proximity/geometry/error.h"
#include "ros/common/text.h"
#include "ros/model/model_loader.h"

namespace ist {
namespace {

constexpr std::size_t kMostAttached = 100;
constexpr std::chrono::seconds kAttachTime(30);  // reading and packing included

std::string not_ready(const ModelState& state) {
  return "the robot's model is not ready yet: " + state.problem;
}

std::vector<AttachedObject>::iterator find_object(const std::string& name,
                                                  std::vector<AttachedObject>* objects) {
  return std::find_if(objects->begin(), objects->end(),
                      [&](const AttachedObject& object) { return object.name == name; });
}

std::string not_attached(const std::string& name, const std::vector<AttachedObject>& objects) {
  std::vector<std::string> names;
  names.reserve(objects.size());
  for (const AttachedObject& object : objects) names.push_back(object.name);
  return "no object '" + printable(name) + "' is attached; there is " +
         (names.empty() ? "none at all" : join(names, ", "));
}

}  // namespace

bool ModelLoader::change_cancelled() const {
  return cancelled() || changes_ended_ || change_revoked_ ||
         std::chrono::steady_clock::now() > change_deadline_;
}

std::string ModelLoader::why_cancelled() const {
  if (stop_ || changes_ended_) return "the node is shutting down";
  if (change_revoked_) return "the object was detached while it was being attached";
  if (reload_) return "the robot's model has been loaded again meanwhile; try again";
  return "it takes longer than " + std::to_string(kAttachTime.count()) +
         " s; use a simpler mesh, a primitive shape, or raise ~packing/max_error";
}

/// Makes `name` the object at work, or none where it is empty. The caller holds change_mutex_.
void ModelLoader::begin_change(const std::string& name) {
  const std::lock_guard<std::mutex> lock(mutex_);
  changing_ = name;
  change_revoked_ = false;
  change_deadline_ = std::chrono::steady_clock::now() + kAttachTime;
}

std::string ModelLoader::attach(const std::string& name, const ObjectReader& read) {
  const std::lock_guard<std::mutex> lock(change_mutex_);
  begin_change(name);
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
  if (!state->is_ready()) return not_ready(*state);
  if (state->objects.size() >= kMostAttached) {
    return std::to_string(kMostAttached) + " objects are attached, which is the limit; detach some";
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
  for (;;) {
    const auto state = this->state();
    if (state->is_ready()) return detach_from(state, name);
    const std::optional<std::string> done = detach_while_loading(name);
    if (done) return *done;
  }
}

std::string ModelLoader::detach_from(const std::shared_ptr<const ModelState>& state,
                                     const std::string& name) {
  std::vector<AttachedObject> objects = state->objects;
  const auto found = find_object(name, &objects);
  if (found == objects.end()) return not_attached(name, objects);
  const std::string link = found->link;
  objects.erase(found);
  return change_objects(state, std::move(objects), link);
}

/// Removes an object while no model is in use. One that is being loaded may have it already, so
/// loading begins again; links that are packed by then are in the cache.
/// @returns empty: the model is ready meanwhile, and nothing has changed. Else what detach() does
std::optional<std::string> ModelLoader::detach_while_loading(const std::string& name) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (state_->is_ready()) return std::nullopt;
    const auto found = find_object(name, &objects_);
    if (found == objects_.end()) return not_attached(name, objects_);
    objects_.erase(found);
    reload_ = true;
  }
  return "";
}

std::string ModelLoader::change_objects(const std::shared_ptr<const ModelState>& state,
                                        std::vector<AttachedObject> objects,
                                        const std::string& link) {
  ModelState next = *state;
  next.objects = std::move(objects);
  bool is_made = false;
  RobotModelCallbacks callbacks;
  callbacks.cancelled = [this] { return change_cancelled(); };
  callbacks.warning = [&](const std::string& warning) { ROS_WARN_STREAM(warning); };
  try {
    const auto description =
        std::make_shared<const RobotDescription>(with_objects(*state->description, next.objects));
    const AnytimeModel::Ptr made =
        state->anytime->with_link(description, link, model_config(next), callbacks);
    is_made = made != nullptr;
    if (is_made) {
      take_robot(made, &next);
      finish(*description, &next);
    }
  } catch (const ModelError& error) {
    return error.what();
  }
  if (is_made) {
    for (const LinkModel& built : next.robot->links) {
      if (built.name == link && !built.usable()) return built.error;
    }
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!is_made || stop_ || changes_ended_ || change_revoked_ || reload_) return why_cancelled();
  if (state_ != state) return "the robot's model has been loaded again meanwhile; try again";
  changing_.clear();  // from now on detach() finds it in the model
  objects_ = next.objects;
  state_ = std::make_shared<const ModelState>(std::move(next));
  return "";
}

}  // namespace ist
