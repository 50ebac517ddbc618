#pragma once

#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <tf2/buffer_core.h>

#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "ist_proximity/proximity/self_collision_pairs.h"
#include "ist_proximity/proximity/self_query.h"
#include "ros/model/model_loader.h"
#include "ros/output/closing_speed.h"
#include "ros/parameters/parameters.h"
#include "ros/poses/joint_state_listener.h"
#include "ros/poses/pose_source.h"

namespace ist {

/// Link against link: ~self_proximity at ~self_collision/rate of the wall clock, in a thread of its
/// own. Pairs that are left out: those that joints connect directly or fixed joints alone,
/// ~self_collision/ignore, the SRDF's <disable_collisions> where robot_description_semantic holds
/// one, and those that are in contact at rest.
class SelfProximity {
 public:
  /// @param nh       where `robot_description_semantic` is searched, and above
  /// @param buffer   outlives this
  /// @param joints   outlives this; null: link poses come from the buffer
  /// @param live     what is configured now; called from the thread
  SelfProximity(const ros::NodeHandle& nh, ros::NodeHandle private_nh, const ServerConfig& config,
                const tf2::BufferCore& buffer, JointStateListener* joints,
                std::function<LiveConfig()> live);
  ~SelfProximity();
  SelfProximity(const SelfProximity&) = delete;
  SelfProximity& operator=(const SelfProximity&) = delete;

  /// Thread safe.
  void set_model(std::shared_ptr<const ModelState> model);

 private:
  void run();
  void run_once();
  void take_model();
  std::vector<LinkPair> choose_pairs() const;
  NamePairs ignored_pairs() const;
  LinkProximity nearest(std::size_t link, std::size_t* other) const;
  void find_wrenches(const LiveConfig& live);
  Wrench penetration(std::size_t link, const LinkProximity& answer) const;

  const ServerConfig config_;
  ros::NodeHandle nh_;
  const tf2::BufferCore& buffer_;
  JointStateListener* const joints_;
  const std::function<LiveConfig()> live_;
  ros::Publisher publisher_;

  std::mutex mutex_;
  std::condition_variable stop_signal_;
  bool stop_ = false;
  std::shared_ptr<const ModelState> newest_model_;

  // The thread's own.
  std::shared_ptr<const ModelState> model_;
  std::unique_ptr<SelfQuery> query_;  ///< null without a model, or its kinematics
  std::unique_ptr<PoseSource> pose_source_;
  std::vector<ClosingSpeed> speeds_;  ///< by link of the robot
  ros::Time last_now_;
  StampedLinkPoses poses_;
  std::vector<PairProximity> results_;
  std::vector<Wrench> wrenches_;  ///< by pair, on its first link
  std::thread thread_;
};

}  // namespace ist
