#pragma once

#include <ros/time.h>

#include <chrono>
#include <string>
#include <vector>

#include "ros/input/measurement.h"
#include "ros/input/source.h"
#include "ros/poses/transform_buffer.h"

namespace ist {

/// Finds the poses of sensor and robot at the instants of a measurement. It never waits itself: the
/// source keeps a measurement until missing_transform() is empty. This takes the place of
/// tf2_ros::MessageFilter, which can neither give up on a single frame (setTargetFrames() needs
/// clear(), which races with the tf listener's thread) nor name the transform that it waits for.
/// Not thread safe.
class Placer {
 public:
  /// @param config, buffer  outlive this
  Placer(const SourceConfig& config, const TransformBuffer& buffer);

  /// Tells that the target's model or generation is new: all links get time to appear in tf.
  void begin_target();

  /// @param target  its model is not null
  /// @returns empty when all poses are known that are worth waiting for, else a sentence
  std::string missing_transform(const Measurement& measurement, const SourceTarget& target) const;

  /// Looks up the poses.
  /// @param target  its model is not null
  /// @returns empty on success, else a sentence
  std::string place(const Measurement& measurement, const SourceTarget& target,
                    Placement* placement) const;

 private:
  bool is_worth_waiting_for(const std::string& link, const std::string& fixed_frame,
                            const ros::Time& stamp) const;
  /// By link: the last of its poses that the self-filter is given.
  struct FilterPoses {
    std::vector<Eigen::Isometry3d> X_FL;
    std::vector<bool> known;
    std::vector<std::size_t> solid;  ///< its number in Placement::robot
  };
  void pose_robot(const SourceTarget& target, const ros::Time& stamp, std::size_t instant,
                  FilterPoses* last, Placement* placement) const;

  const SourceConfig& config_;
  const double patience_;  ///< [s] a cloud waits this long at most for one link's pose
  const TransformBuffer& buffer_;
  std::chrono::steady_clock::time_point target_since_;
};

}  // namespace ist
