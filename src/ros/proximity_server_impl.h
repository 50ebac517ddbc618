#pragma once

#include <ist_proximity/ProximityArray.h>
#include <ros/node_handle.h>
#include <ros/time.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "ist_proximity/ros/proximity_server.h"
#include "ros/add_ons/add_on.h"
#include "ros/common/callback_thread.h"
#include "ros/common/stop_signal.h"
#include "ros/cycle/proximity_cycle.h"
#include "ros/cycle/scene_warm_up.h"
#include "ros/input/source_memory.h"
#include "ros/input/zone_store.h"
#include "ros/model/contact_loader.h"
#include "ros/model/counted_links.h"
#include "ros/model/model_loader.h"
#include "ros/output/markers.h"
#include "ros/output/message_pool.h"
#include "ros/output/speed_scale_publisher.h"
#include "ros/output/sphere_publisher.h"
#include "ros/parameters/live_parameters.h"
#include "ros/parameters/parameters.h"
#include "ros/poses/joint_state_listener.h"
#include "ros/poses/transform_buffer.h"
#include "ros/poses/usual_period.h"
#include "ros/services/ignore_service.h"
#include "ros/services/model_services.h"
#include "ros/services/query_service.h"
#include "ros/services/zone_services.h"
#include "ros/status/cycle_report.h"
#include "ros/status/diagnostics_publisher.h"

namespace ist {

/// Owns all parts and runs the cycle. doc/architecture.md lists the threads.
///
/// The cycle takes the newest poses and clouds, queries and publishes, and waits for nothing. It
/// runs at ~rate of the wall clock, so that a paused /clock does not silence it, or with
/// pose_source joint_states once for each joint state, and ten times a second while none come.
class ProximityServer::Impl {
 public:
  Impl(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh, const ServerConfig& config);
  ~Impl();

 private:
  using Clock = std::chrono::steady_clock;

  // A cycle runs at least this often with pose_source joint_states.
  static constexpr std::chrono::milliseconds kMaxWaitForJointStates{100};
  static constexpr double kLongestPeriod = 0.1;  ///< [s] the same

  void add_source(const SourceConfig& config, const ros::Publisher& filtered);
  void run_cycles();
  bool wait_for_joint_states();
  void run_cycle();
  void run_cycle_guarded();
  void publish_failure(const std::string& fault);
  void publish(const ist_proximity::ProximityArrayConstPtr& message, bool is_of_cycle,
               const SpeedScaleConfig& speed_scale);
  void notice_clock_jump(const ros::Time& now);
  void take_model();
  void choose_counted_links();
  void notice_standing_root();
  void notice_ignored_links(const ros::Time& now);
  void refine_model(std::shared_ptr<const ModelState> model);
  void set_source_targets(const QueryConfig& query);
  void make_services();
  ist_proximity::ProximityArrayConstPtr newest_self_proximity() const;
  double largest_extent() const;
  void publish_diagnostics_when_due();
  void publish_diagnostics();
  LiveConfig live_config() const;
  double period() const;

  const ServerConfig config_;
  ros::NodeHandle nh_, private_nh_;
  ros::Publisher proximity_, joint_repulsion_, markers_;
  SpeedScalePublisher summary_;
  ProximityMarkers marker_drawer_;
  SpherePublisher spheres_;
  DiagnosticsPublisher diagnostics_;
  CallbackThread pose_thread_;  ///< of tf and the joint states
  TransformBuffer buffer_;
  ZoneStore zones_;
  SourceMemories memories_;
  SceneWarmUp warm_up_{sources_};  ///< used by the threads of the sources
  CloudSources sources_;
  std::vector<std::shared_ptr<Source>> inputs_;  ///< those of them that are no memories
  CallbackThread model_thread_;                  ///< loads, packs volumes, attaches
  ModelLoader loader_;
  LiveParameters live_;
  ContactLoader contact_loader_;
  std::unique_ptr<ModelServices> model_services_;
  IgnoreService ignore_service_;
  ZoneServices zone_services_;

  StopSignal cycle_signal_;  ///< joint states are its events
  std::atomic<std::uint64_t> joint_states_received_{0};
  UsualPeriod joint_state_period_{kLongestPeriod};
  std::unique_ptr<JointStateListener> joint_states_;  ///< null with pose_source tf

  std::mutex report_mutex_;
  CycleReport report_;           ///< of the cycle, for the diagnostics
  std::string counted_problem_;  ///< what is wrong with names of links that are configured

  // Used by the thread of ~query alone.
  Clock::time_point next_diagnostics_ = Clock::now() + std::chrono::seconds(1);

  // Used by the cycle thread alone.
  std::shared_ptr<const ModelState> model_;
  std::unique_ptr<ProximityCycle> cycle_;  ///< null without a model
  MessagePool<ist_proximity::ProximityArray> messages_;
  double margin_ = 0.0;  ///< ~query/margin that the regions of interest are made with
  CountedLinks counted_;
  std::vector<std::string> ignored_;  ///< links that ~ignore_links leaves out
  bool root_stands_still_ = false;    ///< in a fixed frame that the URDF lacks
  Clock::time_point next_root_check_;
  double region_radius_ = 0.0;  ///< [m] the largest of this robot
  ros::Time last_now_;
  ros::Time last_stamp_;  ///< of the last ~proximity
  Clock::time_point next_markers_;

  AddOns add_ons_;
  std::unique_ptr<QueryService> query_service_;
  std::thread cycle_thread_;
};

}  // namespace ist
