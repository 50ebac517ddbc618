#include "ros/input/scene_request.h"

#include <ros/connection.h>
#include <ros/serialization.h>
#include <ros/service_manager.h>
#include <std_msgs/UInt32.h>

#include "ros/common/exceptions.h"

namespace ist {
namespace {

constexpr std::chrono::seconds kPatience(5);

// moveit_msgs/PlanningSceneComponents: attached objects, geometry of objects, octomap, transforms,
// allowed collision matrix. States of joints come without being asked for where they are needed.
constexpr std::uint32_t kComponents = 4U | 16U | 32U | 64U | 128U;

// The md5sum of moveit_msgs/GetPlanningScene, whose response holds a scene of the layout.
const char* service_md5sum(SceneLayout layout) {
  return layout == SceneLayout::kShapePoses ? "2745cf315b4eb5fb00e5befa8714d64d"
                                            : "65cf69d3e7a0342e16374024d4eeef65";
}

}  // namespace

void SceneRequest::start() {
  if (is_pending()) return;
  answer_ = Answer();
  is_done_ = false;
  is_ended_ = false;
  deadline_ = std::chrono::steady_clock::now() + kPatience;
  thread_ = std::thread([this] {
    const std::string fault = exception_of([this] { run(); });
    if (!fault.empty()) answer_.fault = service_ + ": " + fault;
    is_done_ = true;
  });
}

bool SceneRequest::take(Answer* answer) {
  if (!is_pending()) return false;
  const bool is_late = std::chrono::steady_clock::now() > deadline_;
  if (!is_done_ && !is_late) return false;
  const bool is_answered = is_done_;
  end();
  *answer = std::move(answer_);
  if (!is_answered) {
    *answer = Answer();
    answer->fault =
        service_ + " has not answered within " + std::to_string(kPatience.count()) + " s";
  }
  return true;
}

void SceneRequest::end() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    is_ended_ = true;
    if (link_) link_->getConnection()->drop(ros::Connection::Destructing);
  }
  if (thread_.joinable()) thread_.join();
}

// A server refuses a md5sum that is not its own, so the layout is known by who answers.
void SceneRequest::run() {
  const SceneLayout other =
      first_ == SceneLayout::kObjectPose ? SceneLayout::kShapePoses : SceneLayout::kObjectPose;
  answer_.fault = ask(first_);
  if (answer_.fault.empty()) return;
  if (!ask(other).empty()) return;
  answer_.fault.clear();
  first_ = other;
}

// Sets the answer's bytes and layout, or returns why there are none.
std::string SceneRequest::ask(SceneLayout layout) {
  const std::string md5sum = service_md5sum(layout);
  const ros::ServiceServerLinkPtr link =
      ros::ServiceManager::instance()->createServiceServerLink(service_, false, md5sum, md5sum, {});
  if (!link) return "no service " + service_ + " is there";
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (is_ended_) return service_;  // nobody reads it
    link_ = link;
  }
  std_msgs::UInt32 components;
  components.data = kComponents;
  const ros::SerializedMessage request = ros::serialization::serializeMessage(components);
  ros::SerializedMessage response;
  const bool is_answered = link->call(request, response);
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    link_.reset();
  }
  if (!is_answered) {
    return service_ + " does not answer, or is no moveit_msgs/GetPlanningScene of Indigo to Noetic";
  }
  const auto* end = response.buf.get() + response.num_bytes;
  answer_.bytes.assign(static_cast<const std::uint8_t*>(response.message_start), end);
  answer_.layout = layout;
  return "";
}

}  // namespace ist
