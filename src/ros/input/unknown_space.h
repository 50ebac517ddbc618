#pragma once

#include <ros/publisher.h>
#include <ros/time.h>

#include <Eigen/Geometry>
#include <chrono>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "ist_proximity/cloud/cloud_snapshot.h"
#include "ist_proximity/cloud/seen_space.h"
#include "ros/common/stop_signal.h"
#include "ros/input/source_memory.h"
#include "ros/poses/transform_buffer.h"

namespace ist {

/// The space about the robot that no memory knows, at one instant. Immutable.
struct UnknownSnapshot {
  std::string frame;                                   ///< tf's name of the memories' frame M
  std::shared_ptr<const BoxIndex> boxes;               ///< of unknown space, in M
  Eigen::Vector3d center_M = Eigen::Vector3d::Zero();  ///< [m] they fill a sphere about the robot
  double radius = 0.0;                                 ///< [m] of that sphere
  double stamp = 0.0;                                  ///< [s] of the newest cloud in it
  SeenSpace seen;
};

/// Joins what the memories of all sources know, a few times a second in a thread of its own, and
/// makes boxes of the rest (~unknown_space). What becomes known in between counts as unknown still.
class UnknownSpaceWatch {
 public:
  /// @param memories  with the same resolution and frame
  /// @param range     [m] farther from the robot nothing is asked
  /// @param publisher  of a MarkerArray that shows the boxes, while somebody listens
  /// @param drawn_range  [m] farther from the robot no boxes are drawn
  /// @param buffer  outlives this
  UnknownSpaceWatch(SourceMemories memories, double range, const ros::Publisher& publisher,
                    double drawn_range, const TransformBuffer& buffer);
  ~UnknownSpaceWatch();

  /// The newest snapshot; null: nothing has been seen yet. It stays valid until the next call and
  /// never waits. The cycle's thread only.
  const UnknownSnapshot* newest();
  /// The same for any other thread; valid as long as it is held.
  std::shared_ptr<const UnknownSnapshot> share() const;

  /// Looks up where the memories' frame is at an instant, or else at the newest one. Thread safe.
  /// @param max_age  [s] allowed age of that instant
  /// @param X_FM     set on success
  /// @returns empty on success, else a sentence
  std::string place(const UnknownSnapshot& unknown, const std::string& fixed_frame,
                    const ros::Time& time, double max_age, Eigen::Isometry3d* X_FM) const;

  /// [m] Space nearer to a link than this may be the robot's own, and counts as known.
  double skin() const { return skin_; }

 private:
  void run();
  std::shared_ptr<const UnknownSnapshot> look();
  void publish_when_due(const VoxelBoxes& boxes, const KnownSpace& known);

  const SourceMemories memories_;
  const double range_;
  const ros::Publisher publisher_;
  const double drawn_range_;
  const TransformBuffer& buffer_;
  std::chrono::steady_clock::time_point next_publication_;  ///< used by the thread alone
  double skin_ = 0.0;
  SnapshotChannel<std::shared_ptr<const UnknownSnapshot>> channel_;
  mutable std::mutex mutex_;
  std::shared_ptr<const UnknownSnapshot> shared_;  ///< guarded by mutex_
  StopSignal stop_;
  std::thread thread_;
};

}  // namespace ist
