#include "ros/model/contact_loader.h"

#include <ros/console.h>

#include <algorithm>
#include <chrono>
#include <exception>
#include <string>
#include <utility>
#include <vector>

#include "ist_proximity/robot/robot_model.h"
#include "ros/common/exceptions.h"

namespace ist {
namespace {

constexpr std::chrono::milliseconds kPoll(200);

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

ContactLoader::ContactLoader(const ServerConfig& config, const ModelLoader& loader)
    : config_(config), loader_(loader) {
  if (config_.contacts_wanted) thread_ = std::thread(&ContactLoader::run, this);
}

ContactLoader::~ContactLoader() {
  stop_signal_.stop();
  if (thread_.joinable()) thread_.join();
}

std::shared_ptr<const ContactModel> ContactLoader::contacts() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return contacts_;
}

void ContactLoader::set(std::shared_ptr<const ContactModel> contacts) {
  const std::lock_guard<std::mutex> lock(mutex_);
  contacts_ = std::move(contacts);
}

bool ContactLoader::is_current(const ModelState& state) const {
  return !stop_signal_.stopped() && loader_.state()->robot == state.robot;
}

void ContactLoader::run() {
  do {
    const std::string fault = exception_of([this] {
      const auto state = loader_.state();
      const auto contacts = this->contacts();
      if (state->robot && (!contacts || contacts->robot != state->robot)) load(state);
    });
    // No memory, for example; the next round tries again.
    if (!fault.empty()) {
      ROS_ERROR_STREAM_THROTTLE(5.0, "contact volumes cannot be computed: " << fault);
    }
  } while (stop_signal_.sleep_until(StopSignal::Clock::now() + kPoll));
}

void ContactLoader::load(const std::shared_ptr<const ModelState>& state) {
  const auto begin = std::chrono::steady_clock::now();
  const RobotModel& robot = *state->robot;
  const RobotDescription description = with_objects(*state->description, state->objects);
  std::map<std::string, std::shared_ptr<const ContactGeometry>> bodies;
  std::vector<std::string> keys(robot.links.size());
  ContactModel contacts;
  contacts.robot = state->robot;
  contacts.links.resize(robot.links.size());
  for (const std::size_t i : state->monitored) {
    const LinkDescription* link = find_link(description, robot.links[i].name);
    if (link == nullptr || !robot.links[i].usable()) continue;
    keys[i] = contact_geometry_key(link->geometry, link->attached, config_.contacts);
    const auto known = known_.find(keys[i]);
    if (known != known_.end()) contacts.links[i] = bodies[keys[i]] = known->second;
  }
  set(std::make_shared<const ContactModel>(contacts));

  const auto cancelled = [&] { return !is_current(*state); };
  for (const std::size_t i : state->monitored) {
    if (keys[i].empty() || contacts.links[i]) continue;
    std::shared_ptr<const ContactGeometry>& body = bodies[keys[i]];
    if (!body)
      body = build(*find_link(description, robot.links[i].name), robot.links[i], cancelled);
    if (!body || cancelled()) return;
    contacts.links[i] = body;
    set(std::make_shared<const ContactModel>(contacts));
  }
  known_ = std::move(bodies);
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  ROS_INFO("contact volumes of %zu links ready after %.1f s", state->monitored.size(),
           took.count());
}

/// @returns null when cancelled
std::shared_ptr<const ContactGeometry> ContactLoader::build(
    const LinkDescription& link, const LinkModel& model,
    const std::function<bool()>& cancelled) const {
  std::shared_ptr<const ContactGeometry> body;
  try {
    body = build_contact_geometry(link.geometry, link.attached, model, config_.contacts,
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
