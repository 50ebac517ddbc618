#pragma once

#include <ros/time.h>
#include <tf2/buffer_core.h>

#include <Eigen/Geometry>
#include <string>
#include <vector>

namespace ist {

/// Where the links are at one common instant.
struct LinkPoses {
  ros::Time stamp;                      ///< that instant; the present one when no link is known
  std::vector<Eigen::Isometry3d> X_FL;  ///< by link: link frame -> fixed frame; valid where known
  std::vector<bool> known;              ///< by link
  std::vector<std::string> problems;    ///< by link: why not; empty where known or not wanted

  std::size_t count_known() const;
};

/// Reads link poses from tf.
///
/// All poses belong to one instant, the newest at which every fresh link is known; mixing instants
/// would tear a moving arm apart. A link that has not moved on for longer than the timeout is not
/// known and does not hold back the others. Static links are known at any instant.
/// Not thread safe; the buffer may be fed meanwhile. Never waits.
class PoseSource {
 public:
  /// @param buffer        outlives this
  /// @param fixed_frame   frame F
  /// @param link_frames   by link
  /// @param wanted        by link: false leaves it unknown and out of everything
  /// @param timeout       [s]
  PoseSource(const tf2::BufferCore& buffer, std::string fixed_frame,
             std::vector<std::string> link_frames, std::vector<bool> wanted, double timeout);

  /// @param now  of the ROS clock; 0 (no clock yet) makes every link unknown
  void look_up(const ros::Time& now, LinkPoses* poses);

 private:
  /// Newest instant of one link; false and a sentence when there is none or it is too old.
  bool newest(std::size_t link, const ros::Time& now, ros::Time* stamp, std::string* problem);

  const tf2::BufferCore& buffer_;
  std::string fixed_frame_;
  std::vector<std::string> frames_;
  std::vector<bool> wanted_;
  double timeout_;
};

}  // namespace ist
