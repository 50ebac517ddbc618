#pragma once

#include <memory>
#include <mutex>

#include "ist_proximity/cloud/cloud_snapshot.h"
#include "ros/input/source_snapshot.h"

namespace ist {

/// Hands the snapshots of one source from its thread to the threads that query.
class SnapshotExchange {
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

  /// Makes writable() the newest snapshot. The source's thread only.
  void publish();

  /// The newest snapshot; null before the first. It stays valid until the next call and never
  /// waits. The cycle's thread only.
  const std::shared_ptr<SourceSnapshot>& newest();

  /// The newest snapshot; null before the first. It stays valid as long as it is held. Thread safe.
  std::shared_ptr<const SourceSnapshot> share() const;

 private:
  SnapshotChannel<std::shared_ptr<SourceSnapshot>> channel_;
  int spare_age_ = 0;  ///< snapshots since a third one was needed; the source's thread only
  mutable std::mutex mutex_;
  std::shared_ptr<const SourceSnapshot> shared_;  ///< guarded by mutex_
};

}  // namespace ist
