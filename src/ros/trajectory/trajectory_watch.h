#pragma once

#include <ist_proximity/TrajectoryClearance.h>
#include <ros/callback_queue.h>
#include <ros/message_event.h>
#include <ros/node_handle.h>
#include <sensor_msgs/JointState.h>
#include <trajectory_msgs/JointTrajectory.h>

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <unordered_map>
#include <vector>

#include "ros/add_ons/add_on.h"
#include "ros/services/stated_cycle.h"
#include "ros/trajectory/watched_trajectory.h"

namespace ist {

/// Watches the trajectory on ~trajectory that a controller follows: publishes ~trajectory_clearance
/// with every new cloud, ten times a second at least, until the trajectory is over, and cancels the
/// action's goals, if asked to, when braking is due or what is left is not known.
///
/// A message without points ends the watch. One that cannot be watched ends it too, and is told as
/// UNKNOWN until another one comes: what is running then is not known. So is a robot that is not
/// where the trajectory has it. Links that the trajectory does not move do not count while it moves
/// no known object, nor those that ~ignore_links leaves out of ~min_distance. While somebody
/// listens to ~trajectory_markers, the robot is drawn where it touches. It is called by the thread
/// of one callback queue.
class TrajectoryWatch : public AddOn {
 public:
  explicit TrajectoryWatch(const AddOnContext& node);

  void subscribe(ros::CallbackQueue* queue) override;
  void run_when_due() override;

 private:
  using Clock = std::chrono::steady_clock;
  using Message = ist_proximity::TrajectoryClearance;
  /// Positions of joints that are older than this are not known.
  static constexpr std::chrono::milliseconds kStateTimeout{500};
  using Event = ros::MessageEvent<const trajectory_msgs::JointTrajectory>;
  struct Position {
    JointMotionNow motion;
    Clock::time_point received;
  };

  void receive(const Event& event);
  void receive_state(const sensor_msgs::JointStateConstPtr& message);
  JointMotionNow present(const std::string& joint) const;
  std::string take_trajectory();
  void note_before(const WatchedTrajectory& before);
  std::string why_elsewhere(double time);
  void look(const ros::Time& now, Message* message);
  double obstacle_age(const ros::Time& now, double time) const;
  void fill(const std::vector<LinkClearance>& found, const std::vector<bool>& moved, double now,
            Message* message);
  void fill_contact(std::size_t link, double contact, double now, Message* message);
  std::vector<bool> moved_links(const ros::Time& now) const;
  void draw(const Message& message);
  void publish(Message* message, std::uint8_t state, const std::string& text);
  void cancel_when_due(const ros::Time& now);

  AddOnContext node_;
  const ServerConfig config_;
  StatedCycle stated_;
  ros::Publisher publisher_, markers_, cancel_;
  ros::Subscriber trajectories_, states_;
  ros::WallTimer timer_;  ///< wakes the thread while a trajectory is watched

  std::unordered_map<std::string, Position> positions_;
  trajectory_msgs::JointTrajectoryConstPtr received_;  ///< null: it has been read
  ros::Time received_time_;
  bool is_watching_ = false;  ///< a trajectory, or one that was refused
  std::string refusal_;       ///< why the last one is not watched; empty: it is
  WatchedTrajectory trajectory_;
  ros::Time followed_until_;                  ///< when the one before it ends
  std::shared_ptr<const ModelState> model_;   ///< of the trajectory's joints
  ist_proximity::ProximityArray here_;        ///< the robot where it is to be now
  std::vector<const CloudSnapshot*> clouds_;  ///< those of the last answer
  Clock::time_point last_look_, listening_since_;
  ros::Time brake_;          ///< zero: not needed
  double took_ = 0.0;        ///< [s] the last answer
  bool is_unknown_ = false;  ///< what the last answer said
};

}  // namespace ist
