#include "ros/model/contact_loader.h"

#include <ros/console.h>

#include <algorithm>
#include <exception>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "ist_proximity/robot/robot_model.h"
#include "ros/common/exceptions.h"
#include "ros/common/memory.h"

namespace ist {
namespace {

const LinkDescription* find_link(const RobotDescription& description, const std::string& name) {
  const auto found = std::find_if(description.links.begin(), description.links.end(),
                                  [&](const LinkDescription& link) { return link.name == name; });
  return found != description.links.end() ? &*found : nullptr;
}

/// Stands for a link without a volume; the note says why.
std::shared_ptr<const ContactGeometry> no_body(const std::string& note) {
  auto body = std::make_shared<ContactGeometry>();
  body->note = note;
  return body;
}

}  // namespace

bool ContactLoader::is_current(const ModelState& state) const {
  if (is_interrupted_()) return false;
  const auto newest = loader_.state();
  return newest->robot && same_geometry(*newest->robot, *state.robot);
}

void ContactLoader::pack_when_due() {
  if (config_.contacts_wanted == ContactsWanted::kNone) return;
  bool is_new = false;
  const std::string fault = exception_of([this, &is_new] {
    while (follow()) is_new = true;
  });
  // No memory, for example; the next round tries again.
  if (!fault.empty()) {
    ROS_ERROR_STREAM_THROTTLE(5.0, "contact volumes cannot be computed: " << fault);
  }
  if (is_new) return_free_memory();  // packing needs some megabytes
}

/// Makes one body of the newest model, which may be another one than for the last body.
/// @returns false where there is nothing to do
bool ContactLoader::follow() {
  const auto state = loader_.state();
  if (!state->robot || is_interrupted_()) return false;
  const auto contacts = this->contacts();
  if (!contacts || !same_geometry(*contacts->robot, *state->robot)) begin(*state);
  return add_next(*state);
}

/// Begins a model with the bodies that are known from the last one.
void ContactLoader::begin(const ModelState& state) {
  const RobotModel& robot = *state.robot;
  model_ = state.anytime;
  keys_.assign(robot.links.size(), "");
  needed_.assign(robot.links.size(), Clock::time_point::max());
  std::map<std::string, std::shared_ptr<const ContactGeometry>> bodies;
  ContactModel contacts;
  contacts.robot = state.robot;
  contacts.links.resize(robot.links.size());
  std::vector<std::size_t> links = state.monitored;
  links.insert(links.end(), state.paired.begin(), state.paired.end());
  for (const std::size_t i : links) {
    const LinkDescription* link = find_link(model_->description(), robot.links[i].name);
    if (link == nullptr || !robot.links[i].usable()) continue;
    keys_[i] = contact_geometry_key(link->geometry, link->attached, ContactConfig());
    const auto known = known_.find(keys_[i]);
    if (known != known_.end()) contacts.links[i] = bodies[keys_[i]] = known->second;
  }
  known_ = std::move(bodies);
  std::atomic_store(&contacts_, std::make_shared<const ContactModel>(std::move(contacts)));
}

bool ContactLoader::is_needed(const ModelState& state, std::size_t link) {
  const Clock::time_point now = Clock::now();
  if (needed_[link] == Clock::time_point::max() &&
      (config_.contacts_wanted == ContactsWanted::kAll || state.usage->was_near(link))) {
    needed_[link] = now;
  }
  return needed_[link] != Clock::time_point::max() &&
         (state.robot->links[link].is_final || now - needed_[link] > kMaxWait);
}

/// Makes the body that has been needed for the longest time.
/// @returns false where there is none, or the work was cancelled
bool ContactLoader::add_next(const ModelState& state) {
  const auto contacts = this->contacts();
  std::optional<std::size_t> next;
  for (std::size_t i = 0; i < keys_.size(); ++i) {
    if (keys_[i].empty() || contacts->links[i] || !is_needed(state, i)) continue;
    if (!next || needed_[i] < needed_[*next]) next = i;
  }
  if (!next) return false;
  std::shared_ptr<const ContactGeometry>& body = known_[keys_[*next]];
  if (!body) {
    const LinkModel& link = state.robot->links[*next];
    body = build(*find_link(model_->description(), link.name), link,
                 [&] { return !is_current(state); });
  }
  if (!body) {
    known_.erase(keys_[*next]);
    return false;
  }
  ContactModel more = *contacts;
  more.links[*next] = body;
  std::atomic_store(&contacts_, std::make_shared<const ContactModel>(std::move(more)));
  return true;
}

/// @returns null when cancelled
std::shared_ptr<const ContactGeometry> ContactLoader::build(
    const LinkDescription& link, const LinkModel& model,
    const std::function<bool()>& cancelled) const {
  std::shared_ptr<const ContactGeometry> body;
  try {
    body = build_contact_geometry(link.geometry, link.attached, model, ContactConfig(),
                                  config_.model.cache_directory, cancelled);
  } catch (const std::exception& error) {  // ModelError, or no memory
    body = no_body(std::string("its volume cannot be packed: ") + error.what());
  }
  if (body && !body->note.empty()) {
    ROS_WARN_STREAM("link '" << link.name << "': " << body->note);
  }
  return body;
}

}  // namespace ist
