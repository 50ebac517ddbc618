#pragma once

#include <ros/time.h>

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/cloud/cloud_snapshot.h"
#include "ist_proximity/proximity/world_query.h"
#include "ist_proximity/robot/robot_model.h"
#include "ros/input/zone_store.h"
#include "ros/poses/transforms.h"

namespace ist {

/// A cloud as queries see it, and the model and frames that it was made with.
struct SourceSnapshot {
  CloudSnapshot cloud;
  ros::Time stamp;
  ros::Time counts_from;  ///< see Measurement::counts_from()
  std::shared_ptr<const RobotModel> model;
  /// By link: false where the self-filter had no pose at the cloud's stamp, so that points on that
  /// link are still among the obstacles. Empty: the source does not filter.
  std::vector<bool> filtered;
  std::uint64_t generation = 0;        ///< see SourceTarget
  std::string fixed_frame, map_frame;  ///< the frames between which the cloud or map is placed
  std::uint64_t static_changes = 0;    ///< TransformBuffer::static_changes() when it was placed
  /// The map's boxes -> `map_frame`.
  Eigen::Isometry3d X_BM = Eigen::Isometry3d::Identity();
  /// The lags of the frames of a map or of known objects whose poses are late, see look_up_for().
  std::vector<std::array<Lag, 2>> lags;
  /// The obstacles that the source remembers and the cloud does not show; null: none.
  std::shared_ptr<const SourceSnapshot> memory;
  /// By group of the zones: what it holds of the cloud's points, which are no obstacles for the
  /// links in CloudSnapshot::not_for. That of all links holds points for a memory alone.
  std::vector<CloudSnapshot> in_zones;
  /// The zones that have left points out; empty: none has.
  std::vector<std::shared_ptr<const LiveZone>> zones;
  /// A known world, and the surfaces of the model's links; null: a cloud. The boxes of the cloud
  /// belong to the world then.
  PosedWorld world;
  std::shared_ptr<const RobotSurfaces> surfaces;
  std::string incomplete;       ///< what is missing in the world; empty: nothing is
  bool has_messages = true;     ///< whether one has come, where the world has a topic
  std::vector<bool> is_placed;  ///< by frame of the world; its objects are left out where not
  std::string unplaced;         ///< why some of the world is left out; empty: none is
};

/// Appends the clouds of a snapshot that hold obstacles.
void add_clouds(const SourceSnapshot& snapshot, std::vector<const CloudSnapshot*>* clouds);

/// Says which zone has left points out of a snapshot and does not hold any more; empty: all do.
std::string ended_zone(const SourceSnapshot& snapshot, const ros::Time& now);

/// Hands values from one thread to the cycle's, which never waits, and to any others.
template <typename T>
class SharedChannel : public SnapshotChannel<std::shared_ptr<T>> {
 public:
  /// Makes back() the newest value. The writing thread only.
  void publish() {
    std::atomic_store(&shared_, std::shared_ptr<const T>(this->back()));
    SnapshotChannel<std::shared_ptr<T>>::publish();
  }

  /// The newest value; null before the first. It stays valid until the next call and never waits.
  /// The cycle's thread only.
  const std::shared_ptr<T>& newest() {
    this->update();
    return this->front();
  }

  /// The same for any other thread; valid as long as it is held.
  std::shared_ptr<const T> share() const { return std::atomic_load(&shared_); }

 private:
  std::shared_ptr<const T> shared_;  ///< loaded and stored atomically
};

/// Hands the snapshots of one source from its thread to the threads that query.
class SnapshotExchange : public SharedChannel<SourceSnapshot> {
 public:
  /// The snapshot to fill next. It is an old one, whose memory is used again, unless readers hold
  /// all of these: two snapshots do while the cycle takes each one before the next is filled. The
  /// source's thread only.
  SourceSnapshot& writable();

  /// Empties old snapshots that nobody reads any more, so that they let go of their messages, and
  /// frees one that was not needed for the last kSpareAge snapshots. The source's thread only.
  /// @returns false while the cycle has not taken the newest snapshot, and may hold an older one
  bool release_unused();

  /// A cycle that is slower than its source needs a third snapshot all the time; one that was late
  /// needs it once. Ten seconds at 30 Hz.
  static constexpr int kSpareAge = 300;

 private:
  int spare_age_ = 0;  ///< snapshots since a third one was needed; the source's thread only
};

}  // namespace ist
