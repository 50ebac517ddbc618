#pragma once

#include <geometry_msgs/TransformStamped.h>
#include <ros/ros.h>
#include <sensor_msgs/JointState.h>
#include <std_msgs/Float64.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>
#include <visualization_msgs/MarkerArray.h>
#include <xmlrpcpp/XmlRpc.h>

#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "ist_proximity/FilterState.h"
#include "ist_proximity/ProximityArray.h"
#include "ist_proximity/control/constraint_rows.h"
#include "ist_proximity/control/velocity_filter.h"
#include "ros/filter/command_message.h"
#include "ros/filter/joint_history.h"
#include "ros/filter/proximity_rows.h"

namespace ist {

/// The parameters of a velocity filter, read at its start (doc/control.md).
struct FilterConfig {
  RowConfig rows;
  /// "trajectory_msgs/JointTrajectory", "std_msgs/Float64MultiArray", "sensor_msgs/JointState",
  /// "geometry_msgs/TwistStamped" or "geometry_msgs/Twist".
  std::string command_type = "trajectory_msgs/JointTrajectory";
  /// Joints of a Float64MultiArray, in order, or those that realise a twist; empty: all that have a
  /// position of their own.
  std::vector<std::string> joints;
  std::string tool;             ///< link that a twist moves; empty: the frame of one with a stamp
  bool self_proximity = false;  ///< the node's ~self_proximity bounds velocities, too
  double self_stop_distance = 0.01;  ///< [m] nearer than this, no links approach each other
  double command_timeout = 0.1;      ///< [s]
  double proximity_timeout = 0.2;    ///< [s] oldest answer that still counts
  double joint_timeout = 0.1;        ///< [s] oldest joint state that still counts
};

/// Reads what is below the private namespace.
/// @param tree    as the parameter server holds it
/// @param errors    one sentence for each parameter that cannot be used; empty: all can
/// @param warnings  one sentence for each parameter that nothing reads
FilterConfig read_filter_config(const XmlRpc::XmlRpcValue& tree, std::vector<std::string>* errors,
                                std::vector<std::string>* warnings);

/// Does the work of a VelocityFilterServer.
class CommandFilter {
 public:
  /// @throws std::invalid_argument with a sentence for each parameter that cannot be used
  CommandFilter(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh);
  /// Gives 0 once more.
  ~CommandFilter();
  CommandFilter(const CommandFilter&) = delete;
  CommandFilter& operator=(const CommandFilter&) = delete;

 private:
  template <class Message, class... Others>
  void subscribe();
  template <class Message>
  void receive(const Message& message);
  void read_robot();
  void forget_robot();
  /// Gives 0 for all joints that have been commanded.
  void halt(const std::string& reason);
  void halt_late(const ros::Time& now);
  void take(const ist_proximity::ProximityArray::ConstPtr& answers, PlacedAnswers* placed);
  void take_joints(const sensor_msgs::JointState& message);
  void take_scale(const std_msgs::Float64& scale);
  void on_timer();
  bool clock_has_gone_back();

  /// The given velocities, by joint of the command.
  std::vector<double> filter(const JointCommand& command, ist_proximity::FilterState* state);
  std::string why_not(const JointCommand& command, const ros::Time& now) const;
  std::string why_not(const PlacedAnswers& placed, const ros::Subscriber& subscriber,
                      const ros::Time& now) const;
  const FilterAnswer& run(const JointCommand& command, const ros::Time& now);
  bool is_twist_proven(const JointCommand& command, const std::vector<double>& velocity);
  void hold_others(const std::vector<bool>& is_commanded, const ros::Time& now);
  void note_given(const ist_proximity::FilterState& state, bool replaces_all);
  void take_off_given(const ros::Time& now, double horizon);
  /// Whether it can be read and is of the robot's joints.
  bool can_be_used(const JointCommand& command) const;
  void explain(const FilterAnswer& answer, ist_proximity::FilterState* state) const;
  void draw(const FilterAnswer& answer, const std_msgs::Header& header) const;
  std::optional<std::size_t> column_of(const std::string& joint) const;
  double position_of(const std::string& joint) const;

  ros::NodeHandle nh_, private_nh_;
  FilterConfig config_;
  std::string description_;  ///< key of the URDF's parameter
  tf2_ros::Buffer tf_;
  tf2_ros::TransformListener listener_;

  std::shared_ptr<const Kinematics> kinematics_;  ///< null: no URDF yet
  std::string robot_fault_;                       ///< why there is none
  std::string urdf_;
  bool joints_are_stated_;  ///< by ~joints
  std::optional<JointHistory> history_;
  std::optional<ProximityRows> proximity_;
  std::optional<VelocityFilter> filter_;
  PlacedAnswers obstacles_, self_;
  ConstraintRows rows_;
  std::vector<double> q_now_, q_column_, command_column_;
  struct Given {
    ros::Time time;
    std::vector<double> velocity;  ///< [rad/s, m/s] by column
  };
  std::deque<Given> given_;  ///< of the time that joint states may be old
  /// [rad, m] By column: what that was since the joints were stated, of which a robot that lags may
  /// have done less.
  std::vector<double> went_;

  ros::Publisher safe_command_, state_, scale_, markers_;
  ros::Subscriber command_, answers_, self_answers_, joints_, node_scale_;
  ros::WallTimer timer_;
  ros::Time last_now_, last_command_;
  std::chrono::steady_clock::time_point clock_moved_;
  double given_scale_ = 0.0;   ///< of the last command
  double newest_scale_ = 0.0;  ///< the node's, without a command
  ros::Time newest_scale_came_;
  /// Joints that have been commanded together.
  struct Group {
    std::vector<std::string> joints;  ///< sorted; none where the command could not be used
    ros::Time last_command;
    std::function<void(const std::string&)> halt;  ///< gives 0 for them, for a reason
  };
  std::vector<Group> groups_;  ///< that of the last command is the last; empty: there was none
};

}  // namespace ist
