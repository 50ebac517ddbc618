#pragma once

#include <ros/publisher.h>
#include <ros/time.h>
#include <std_msgs/Header.h>
#include <visualization_msgs/MarkerArray.h>

#include <Eigen/Geometry>
#include <chrono>
#include <limits>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "ist_proximity/cloud/cloud_snapshot.h"
#include "ist_proximity/cloud/seen_space.h"
#include "ros/common/stop_signal.h"
#include "ros/input/source_memory.h"

namespace ist {

/// The space about the robot that no memory knows, at one instant. Immutable.
struct UnknownSnapshot {
  std::string frame;                                   ///< the fixed frame's name
  std::shared_ptr<const BoxIndex> boxes;               ///< of unknown space
  Eigen::Vector3d center_F = Eigen::Vector3d::Zero();  ///< [m] they fill a sphere about the robot
  double radius = 0.0;                                 ///< [m] of that sphere
  double stamp = 0.0;                                  ///< [s] of the newest cloud in it
  double found = 0.0;  ///< [s] what was measured longer ago than its memory lasts was left out then
  double lasts = std::numeric_limits<double>::infinity();  ///< [s] that it holds from then on
  std::shared_ptr<const RobotModel> robot;                 ///< whose own space is known
  SeenSpace seen;
};

/// Says why all space counts as unknown at an instant, though some has been seen; empty: it does
/// not.
std::string why_unusable(const UnknownSnapshot& unknown, const RobotModel& robot,
                         const std::string& fixed_frame, const ros::Time& time);

/// Joins what the memories of all sources know, a few times a second in a thread of its own, and
/// makes boxes of the rest (~unknown_space). What becomes known in between counts as unknown still.
class UnknownSpaceWatch {
 public:
  /// @param memories  with the same resolution
  /// @param range     [m] farther from the robot nothing is asked
  /// @param publisher  of a MarkerArray that shows the boxes near the links, while somebody listens
  UnknownSpaceWatch(SourceMemories memories, double range, const ros::Publisher& publisher);
  ~UnknownSpaceWatch();

  /// The newest snapshot; null: nothing has been seen yet. It stays valid until the next call and
  /// never waits. The cycle's thread only.
  const UnknownSnapshot* newest() { return channel_.newest().get(); }
  /// The same for any other thread; valid as long as it is held.
  std::shared_ptr<const UnknownSnapshot> share() const { return channel_.share(); }

  /// [m] Space nearer to a link than this may be the robot's own, and counts as known.
  double skin() const { return skin_; }

 private:
  void run();
  std::shared_ptr<const UnknownSnapshot> look();
  void publish_when_due(const VoxelBoxes& boxes, const KnownSpace& known);

  const SourceMemories memories_;
  const double range_;
  const ros::Publisher publisher_;
  std::chrono::steady_clock::time_point next_publication_;  ///< used by the thread alone
  double skin_ = 0.0;
  double longest_ = std::numeric_limits<double>::infinity();  ///< [s] that what is found holds
  double part_ = 1.0;  ///< of the region that is looked at: less where looks take long
  SharedChannel<const UnknownSnapshot> channel_;
  StopSignal stop_;
  std::thread thread_;
};

/// Draws the unknown space near a robot as small grey cubes, the fainter the farther they are, in
/// place of those drawn before. Where there are more than rviz can turn smoothly, the nearest are
/// drawn.
/// @param boxes  [m] of unknown space
/// @param links  [m] each holds a link, in the same frame
/// @param range  [m] what is farther than this from each of `links` is not drawn
/// @param header  its frame is that of boxes and links
visualization_msgs::MarkerArray unseen_markers(const VoxelBoxes& boxes, const VoxelBoxes& links,
                                               double range, const std_msgs::Header& header);

}  // namespace ist
