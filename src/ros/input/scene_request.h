#pragma once

#include <ros/forwards.h>
#include <ros/service_server_link.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "internal/proximity/planning_scene.h"

namespace ist {

/// Asks a moveit_msgs/GetPlanningScene service for the full scene, without the package of that
/// service. Each request has a thread of its own, because the answer may never come.
///
/// The functions are called by one thread.
class SceneRequest {
 public:
  struct Answer {
    std::vector<std::uint8_t> bytes;  ///< a moveit_msgs/PlanningScene
    SceneLayout layout = SceneLayout::kObjectPose;
    std::string fault;  ///< why there are no bytes; empty: there are
  };

  /// @param service  resolved name
  explicit SceneRequest(std::string service) : service_(std::move(service)) {}
  ~SceneRequest() { end(); }

  const std::string& service() const { return service_; }

  /// Begins a request, unless one is pending.
  void start();

  bool is_pending() const { return thread_.joinable(); }

  /// Ends the pending request if its answer is there, or if it takes more than 5 s.
  /// @returns whether `answer` is set
  bool take(Answer* answer);

 private:
  void run();
  std::string ask(SceneLayout layout);
  void end();

  const std::string service_;
  SceneLayout first_ = SceneLayout::kObjectPose;  ///< which is tried first
  std::chrono::steady_clock::time_point deadline_;
  std::thread thread_;
  std::atomic<bool> is_done_{false};
  Answer answer_;  ///< belongs to the thread until is_done_

  std::mutex mutex_;  ///< of the members below
  bool is_ended_ = false;
  ros::ServiceServerLinkPtr link_;  ///< of the call; dropping its connection ends the call
};

}  // namespace ist
