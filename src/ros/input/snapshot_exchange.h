#pragma once

#include <memory>
#include <mutex>

#include "ist_proximity/cloud/cloud_snapshot.h"
#include "ros/input/source_snapshot.h"

namespace ist {

/// Hands the snapshots of one source from its thread to the threads that query.
class SnapshotExchange {
 public:
  /// The snapshot to fill next. It is an old one, whose memory is used again, unless a reader still
  /// holds that. The source's thread only.
  SourceSnapshot& writable();

  /// Makes writable() the newest snapshot. The source's thread only.
  void publish();

  /// The newest snapshot; null before the first. It stays valid until the next call and never
  /// waits. The cycle's thread only.
  const std::shared_ptr<SourceSnapshot>& newest();

  /// The newest snapshot; null before the first. It stays valid as long as it is held. Thread safe.
  std::shared_ptr<const SourceSnapshot> share() const;

 private:
  SnapshotChannel<std::shared_ptr<SourceSnapshot>> channel_;
  mutable std::mutex mutex_;
  std::shared_ptr<const SourceSnapshot> shared_;  ///< guarded by mutex_
};

}  // namespace ist
