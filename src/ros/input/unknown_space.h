#pragma once

#include <ros/publisher.h>

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
  CloudSnapshot cloud;  ///< boxes of unknown space, and the region about the robot that they fill
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
  UnknownSpaceWatch(SourceMemories memories, double range, const ros::Publisher& publisher,
                    double drawn_range);
  ~UnknownSpaceWatch();
  UnknownSpaceWatch(const UnknownSpaceWatch&) = delete;
  UnknownSpaceWatch& operator=(const UnknownSpaceWatch&) = delete;

  /// The newest snapshot; null: nothing has been seen yet. It stays valid until the next call and
  /// never waits. The cycle's thread only.
  const UnknownSnapshot* newest();
  /// The same for any other thread; valid as long as it is held.
  std::shared_ptr<const UnknownSnapshot> share() const;

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
  std::chrono::steady_clock::time_point next_publication_;  ///< used by the thread alone
  double skin_ = 0.0;
  SnapshotChannel<std::shared_ptr<const UnknownSnapshot>> channel_;
  mutable std::mutex mutex_;
  std::shared_ptr<const UnknownSnapshot> shared_;  ///< guarded by mutex_
  StopSignal stop_;
  std::thread thread_;
};

}  // namespace ist
