#pragma once

#include <diagnostic_msgs/DiagnosticArray.h>
#include <ist_proximity/AttachObject.h>
#include <ist_proximity/DetachObject.h>
#include <ros/node_handle.h>
#include <std_srvs/Trigger.h>
#include <tf2/buffer_core.h>

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <thread>

#include "ros/model/contact_loader.h"
#include "ros/model/model_loader.h"
#include "ros/output/markers.h"
#include "ros/parameters/live_parameters.h"
#include "ros/parameters/parameters.h"
#include "ros/poses/joint_state_listener.h"
#include "ros/poses/transform_listener.h"
#include "ros/proximity_cycle.h"
#include "ros/services/query_service.h"
#include "ros/services/self_proximity.h"
#include "ros/status/diagnostics.h"

namespace ist {

/// The whole of ist_proximity as node and nodelet run it. Threads:
///   - the cycle: it takes the newest poses and clouds, queries and publishes, and waits for
///     nothing; at ~rate of the wall clock (a paused /clock does not silence it), or with
///     pose_source joint_states at each joint state (and, while none come, ten times a second);
///   - one per source, for receiving and ingesting clouds;
///   - ~query, with a query of its own; - ~self_proximity, where it is enabled;
///   - the model loader; - the contact loader, which begins when the model is ready;
///   - the listeners of tf and joint_states;
///   - once a second: diagnostics, and what may change while running is read again
///     (LiveParameters).
/// The other services are answered from the queue of the node handles.
class ProximityServer {
 public:
  /// @param nh          topics like `cloud` are relative to it
  /// @param private_nh  `~`
  ProximityServer(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh,
                  const ServerConfig& config);
  /// Stops all threads; packing is broken off.
  ~ProximityServer();
  ProximityServer(const ProximityServer&) = delete;
  ProximityServer& operator=(const ProximityServer&) = delete;

 private:
  using Clock = std::chrono::steady_clock;

  void advertise();
  void run_cycles();
  bool wait_for_joint_states();
  LiveConfig live_config() const;
  void run_cycle();
  void notice_clock_jump(const ros::Time& now);
  void take_model();
  void aim_sources(const QueryConfig& query);
  void publish(const ist_proximity::ProximityArrayConstPtr& message);
  void publish_joint_repulsion(const ist_proximity::ProximityArray& proximity);
  void publish_spheres();
  void publish_spheres_again();
  void run_diagnostics();
  bool reload_model(std_srvs::Trigger::Request& request, std_srvs::Trigger::Response& response);
  bool attach_object(ist_proximity::AttachObject::Request& request,
                     ist_proximity::AttachObject::Response& response);
  bool detach_object(ist_proximity::DetachObject::Request& request,
                     ist_proximity::DetachObject::Response& response);
  bool sleep_until(Clock::time_point time);  ///< false when it is time to stop

  const ServerConfig config_;
  ros::NodeHandle nh_, private_nh_;
  const std::string name_;  ///< in diagnostics

  ros::Publisher proximity_, joint_repulsion_, min_distance_, markers_, spheres_, filtered_cloud_,
      diagnostics_;
  ros::ServiceServer reload_service_, attach_service_, detach_service_;
  tf2::BufferCore buffer_;
  TransformListener listener_;
  CloudSources sources_;
  ModelLoader loader_;
  LiveParameters live_;
  ContactLoader contact_loader_;
  std::unique_ptr<JointStateListener> joint_states_;  ///< null with pose_source tf

  // The cycle thread's own.
  std::shared_ptr<const ModelState> model_;
  std::unique_ptr<ProximityCycle> cycle_;  ///< null without a model
  ProximityMarkers marker_drawer_;
  double margin_ = 0.0;  ///< ~query/margin that the sources were aimed with
  visualization_msgs::MarkerArray shown_spheres_;
  Clock::time_point spheres_again_ = Clock::time_point::max();  ///< when to latch them anew
  std::chrono::seconds spheres_delay_{0};
  Clock::time_point next_markers_;
  ros::Time last_now_;

  std::mutex shared_mutex_;  // for what cycle and diagnostics threads share
  CycleReport report_;

  std::mutex stop_mutex_;
  std::condition_variable stop_signal_;
  bool stop_ = false;
  std::condition_variable state_signal_;  ///< to stop, or a joint state has come
  std::uint64_t states_come_ = 0;
  std::unique_ptr<QueryService> query_service_;
  std::unique_ptr<SelfProximity> self_proximity_;  ///< null unless enabled
  std::thread cycle_thread_, diagnostics_thread_;
};

}  // namespace ist
