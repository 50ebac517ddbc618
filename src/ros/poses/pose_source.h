#pragma once

#include <ros/time.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cstddef>
#include <string>
#include <vector>

#include "ist_proximity/geometry/span.h"
#include "ist_proximity/proximity/stopping_reach.h"
#include "ist_proximity/robot/kinematics.h"
#include "ist_proximity/robot/link_poses.h"

namespace ist {

/// Why a link or joint has no pose.
struct PoseProblem {
  std::string text;        ///< empty: it has one
  bool explained = false;  ///< the text names the cause, so that no likely one needs to be added

  bool empty() const { return text.empty(); }
};

/// The poses of the links at one common instant.
struct StampedLinkPoses : LinkPoses {
  /// The instant of the poses; when no link is known, now or the stamp before. It never goes back,
  /// unless the owner sets it to 0: look_up() reads the stamp of the last poses here.
  ros::Time stamp;
  std::vector<PoseProblem> problems;  ///< by link: why it is not known; else empty
  std::vector<std::string> doubts;    ///< sentences on poses that are known, and hardly true

  /// Makes every link unknown, without a problem, at an instant that is not before the last stamp.
  void reset(const ros::Time& now, std::size_t links) {
    stamp = std::max(stamp, now);
    X_FL.resize(links, Eigen::Isometry3d::Identity());
    known.assign(links, false);
    problems.assign(links, PoseProblem());
    doubts.clear();
  }
  /// Gives every wanted link the same problem.
  void set_problem(const std::vector<bool>& wanted, const PoseProblem& problem) {
    for (std::size_t i = 0; i < wanted.size(); ++i) {
      if (wanted[i]) problems[i] = problem;
    }
  }
  /// Adds a sentence to `doubts`, once; empty: nothing.
  void add_doubt(const std::string& doubt) {
    const bool is_new = std::find(doubts.begin(), doubts.end(), doubt) == doubts.end();
    if (is_new && !doubt.empty()) doubts.push_back(doubt);
  }
  std::size_t count_known() const {
    return static_cast<std::size_t>(std::count(known.begin(), known.end(), true));
  }
};

/// A source of link poses: tf, or the node's own kinematics. Not thread safe; never waits.
class PoseSource {
 public:
  virtual ~PoseSource() = default;

  /// Looks up the poses of all wanted links.
  /// @param now    the ROS clock's time; 0 (no clock yet) makes every link unknown
  /// @param poses  the result of the last call, overwritten; its stamp does not go back
  virtual void look_up(const ros::Time& now, StampedLinkPoses* poses) = 0;

  /// Looks up the poses of all bodies of the robot, links without geometry too, at the instant of
  /// the last look_up(). Jacobians need them.
  /// @param instant  the stamp that look_up() gave
  virtual void look_up_all(const Kinematics& kinematics, const ros::Time& instant,
                           BodyPoses* bodies) = 0;

  /// How fast the joints moved at the instant of the last look_up() [rad/s, m/s], by joint of the
  /// kinematics: NaN where that is not known. Empty: it is known of none.
  virtual Span<const double> joint_velocities() const { return {}; }

  /// How far the joints may have moved from the positions of the last look_up() until its instant,
  /// where those are older, by joint of the kinematics. Empty: no position is older.
  virtual Span<const StoppingReach> joint_lags() const { return {}; }

  /// Whether the poses are of a configuration that the robot need not be in.
  virtual bool is_stated() const { return false; }

  /// Obstacles in frames that move are looked up in the root link's frame R where each pose is the
  /// newest one, and not that of one common instant: so robot and obstacle are of one instant,
  /// however old the root's own pose is, and however it moves.
  /// @param X_FR  receives the pose of R of the last look_up()
  /// @returns R; empty where poses are of one instant, or R has none
  virtual std::string newest_root(Eigen::Isometry3d* /*X_FR*/) const { return ""; }

  /// The joints are looked up again after the obstacles, with newest_root(): an obstacle on a link
  /// that a joint moves would else be newer than the link. What is older is late, which is taken
  /// off.
  virtual void look_up_joints_again(const ros::Time& /*now*/, StampedLinkPoses* /*poses*/) {}

  /// Names a likely cause for the user whose links have no pose.
  virtual std::string hint() const = 0;
};

}  // namespace ist
