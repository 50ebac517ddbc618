#include <ros/console.h>

#include <algorithm>

#include "ist_proximity/geometry/error.h"
#include "ros/common/text.h"
#include "ros/model/model_loader.h"

namespace ist {
namespace {

std::string not_ready(const ModelState& state) {
  return "the robot's model is not ready yet: " + state.problem;
}

}  // namespace

std::string ModelLoader::attach(const AttachedObject& object) {
  const std::lock_guard<std::mutex> lock(change_mutex_);
  const auto state = this->state();
  if (!state->robot) return not_ready(*state);
  for (const AttachedObject& other : state->objects) {
    if (other.name != object.name) continue;
    return "object '" + object.name + "' is attached to link '" + other.link +
           "' already; detach it first";
  }
  std::vector<AttachedObject> objects = state->objects;
  objects.push_back(object);
  return change_objects(state, std::move(objects), object.link);
}

std::string ModelLoader::detach(const std::string& name) {
  const std::lock_guard<std::mutex> lock(change_mutex_);
  const auto state = this->state();
  if (!state->robot) return not_ready(*state);
  std::vector<AttachedObject> objects = state->objects;
  const auto found = std::find_if(objects.begin(), objects.end(),
                                  [&](const AttachedObject& other) { return other.name == name; });
  if (found == objects.end()) {
    std::vector<std::string> names;
    names.reserve(objects.size());
    for (const AttachedObject& other : objects) names.push_back(other.name);
    return "no object '" + name + "' is attached; there is " +
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
  callbacks.cancelled = [this] { return cancelled(); };
  callbacks.warning = [&](const std::string& warning) { ROS_WARN_STREAM(warning); };
  try {
    const RobotDescription description = with_objects(*state->description, next.objects);
    next.robot = rebuild_link(*state->robot, description, link,
                              model_config(description, next.objects), callbacks);
    if (next.robot) finish(description, &next);
  } catch (const ModelError& error) {
    return error.what();
  }
  if (next.robot) {
    for (const LinkModel& built : next.robot->links) {
      if (built.name == link && !built.usable()) return built.error;
    }
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!next.robot || reload_ || state_ != state) {
    return "the robot's model has been loaded again meanwhile; try again";
  }
  objects_ = next.objects;
  state_ = std::make_shared<const ModelState>(std::move(next));
  return "";
}

}  // namespace ist
