#pragma once

#include <string>
#include <vector>

#include "ros/poses/pose_source.h"
#include "ros/poses/transform_buffer.h"

namespace ist {

/// Reads link poses from tf.
///
/// All poses belong to one instant, the newest at which every fresh link is known; mixed instants
/// would tear a moving arm apart. A link whose newest transform is older than the timeout is
/// unknown and does not hold back the others; its age counts from the receipt of transforms that
/// were stamped ahead of the clock. A link whose pose two publishers state differently is unknown.
/// Static links are known at any instant. The instant never goes back: a link that comes late is
/// unknown until it has caught up. The buffer may be fed at the same time.
class TfPoseSource : public PoseSource {
 public:
  /// @param buffer        outlives this
  /// @param fixed_frame   frame F
  /// @param link_frames   by link
  /// @param wanted        by link: false leaves it unknown, without a problem
  /// @param timeout       [s]
  TfPoseSource(const TransformBuffer& buffer, std::string fixed_frame,
               std::vector<std::string> link_frames, std::vector<bool> wanted, double timeout);

  void look_up(const ros::Time& now, StampedLinkPoses* poses) override;
  void look_up_all(const Kinematics& kinematics, const ros::Time& instant,
                   BodyPoses* bodies) override;
  std::string hint() const override;

 private:
  std::string find_prefixed_frame() const;

  const TransformBuffer& buffer_;
  std::string fixed_frame_;
  std::vector<std::string> frames_;
  std::vector<bool> wanted_;
  double timeout_;
  std::vector<ros::Time> stamps_;  ///< by link; valid for one look_up()
};

}  // namespace ist
