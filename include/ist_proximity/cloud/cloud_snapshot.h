#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/cloud/point_extent.h"
#include "ist_proximity/cloud/view_filter.h"
#include "ist_proximity/geometry/region_of_interest.h"
#include "ist_proximity/geometry/span.h"

namespace ist {

class BoxBvh;
class PointBvh;

/// Points of a cloud, indexed for queries by a bounding volume hierarchy. Coordinates are kept in a
/// frame O of its own: its origin is near the points, so that float loses nothing far from zero,
/// and its axes lie along the scene's surfaces where Ingest has found such, so that boxes are thin;
/// else along the fixed frame's. Immutable once built, thread safe.
class PointIndex {
 public:
  PointIndex();
  PointIndex(const PointIndex& other);
  PointIndex& operator=(const PointIndex& other);  ///< holds all points, independent of the message
  PointIndex(PointIndex&&) noexcept;
  PointIndex& operator=(PointIndex&&) noexcept;
  ~PointIndex();

  /// Builds over points given relative to `origin` (fixed frame, double) along the fixed frame's
  /// axes, in structure-of-arrays. The result depends on nothing but the arguments. For messages
  /// and streams use Ingest, which keeps its working memory; this allocates.
  /// @param x,y,z  n coordinates [m] each, finite, below 1e15
  /// @param id     n identities, carried through to the answers
  void build(const Eigen::Vector3d& origin, const float* x, const float* y, const float* z,
             const std::uint32_t* id, std::size_t n);

  bool empty() const;                     ///< whether it has no points
  std::size_t size() const;               ///< points
  const Eigen::Isometry3d& X_FO() const;  ///< index's -> fixed frame
  Eigen::AlignedBox3f bounds() const;     ///< [m] in O; holds all points
  std::size_t memory() const;  ///< [bytes] reserved; the message it may refer to not counted
  /// Makes it empty, so that it lets go of the message, and keeps its memory for the next build.
  /// Not to be called while others read.
  void clear();
  /// Identifies one build: another number after every build of any index; 0 before the first.
  std::uint64_t build_id() const;

  const PointBvh& bvh() const;  ///< for the library's own use
  PointBvh& bvh();              ///< for the library's own use

 private:
  std::unique_ptr<PointBvh> bvh_;  ///< null: empty, never built
};

/// Solid boxes of any sizes, axis-aligned in a frame M of their own (a map's), indexed for queries
/// by a bounding volume hierarchy. Boxes may overlap or touch. Coordinates are kept relative to
/// `origin`, the middle of all boxes on whole metres, so that float loses no more than 1e-7 of the
/// distance from there. Immutable once built, thread safe.
class BoxIndex {
 public:
  BoxIndex();
  BoxIndex(const BoxIndex&) = default;  // no move: a moved-from index would have no data
  BoxIndex& operator=(const BoxIndex&) = default;

  /// @param boxes  [m] in M, finite, none empty (an edge may be 0), coordinates below 1e15
  void build(const std::vector<Eigen::AlignedBox3d>& boxes);

  bool empty() const;                     ///< whether it has no boxes
  std::size_t size() const;               ///< boxes
  const Eigen::Vector3d& origin() const;  ///< [m] in M
  /// Identifies one build, like PointIndex::build_id(); never equal to that of a PointIndex.
  std::uint64_t build_id() const;

  const BoxBvh& bvh() const { return *bvh_; }  ///< for the library's own use

 private:
  std::shared_ptr<const BoxBvh> bvh_;  ///< never null; copies share it
};

/// Numbers of points of one cloud, by what was done with them.
struct IngestCounts {
  std::uint32_t received = 0;        ///< points in the message
  std::uint32_t not_a_number = 0;    ///< dropped: a coordinate is NaN
  std::uint32_t infinite = 0;        ///< dropped: a coordinate is infinite, and none is NaN
  std::uint32_t out_of_range = 0;    ///< dropped: nearer than min_range or farther than max_range
  std::uint32_t too_near = 0;        ///< of these: nearer than min_range
  std::uint32_t not_believed = 0;    ///< of these: farther than the sensor can measure
  std::uint32_t outside_region = 0;  ///< dropped: in range, but outside the region of interest
  std::uint32_t noise = 0;           ///< dropped by a noise filter that ran before
  std::uint32_t on_robot = 0;        ///< dropped by the self-filter
  std::uint32_t in_zones = 0;        ///< left out by Ingest::set_zones()
  std::uint32_t used = 0;            ///< in the index
  /// Points in a range that counts that all have the same coordinates, where most points do: what
  /// a driver writes in place of a measurement, or a stuck one repeats. Else 0.
  std::uint32_t at_one_place = 0;
  bool infinite_is_free = false;  ///< infinite points measured that nothing is in range

  /// Points that say something about space: an obstacle, or that there is none up to max_range.
  std::uint32_t measured() const {
    const std::uint64_t unknown = std::uint64_t{not_a_number} + noise + too_near + not_believed +
                                  at_one_place + (infinite_is_free ? 0U : infinite);
    return static_cast<std::uint32_t>(received - std::min<std::uint64_t>(unknown, received));
  }
  /// The share of the points that were measured; 1 for an empty cloud, a measurement of nothing.
  double measured_share() const { return received > 0 ? 1.0 * measured() / received : 1.0; }
  /// Whether the sensor saw nothing: there are points, and none was measured.
  bool saw_nothing() const { return received > 0 && measured() == 0; }
  /// Whether enough was measured that the cloud stands for the sensor's view.
  bool saw_enough(double min_share) const {
    return !saw_nothing() && measured_share() >= min_share;
  }
};

/// One cloud or map as queries take it, immutable. A cloud consists of points in the fixed frame, a
/// map of solid boxes in a frame of its own.
struct CloudSnapshot {
  PointIndex index;    ///< all points used
  PointExtent extent;  ///< of the points
  /// Sensor frame -> fixed frame of a cloud, as a self-filter by view has corrected it.
  Eigen::Isometry3d X_FS = Eigen::Isometry3d::Identity();
  double believed_range = std::numeric_limits<double>::infinity();  ///< [m] none was farther
  double thinning = 0.01;                                           ///< [m] edge of a voxel
  RegionOfInterest region;                                 ///< points outside were discarded
  std::shared_ptr<const BoxIndex> boxes;                   ///< the boxes of a map; null: none
  Eigen::Isometry3d X_FM = Eigen::Isometry3d::Identity();  ///< the boxes' frame -> fixed frame
  double box_extent = 0.0;   ///< [m] 0 to kMaxExtent: each box is larger by this on all sides
  IngestCounts counts;       ///< what was done with the points of the message
  ViewReport view;           ///< of a self-filter by view
  double stamp = 0.0;        ///< [s] time of acquisition
  double ingest_time = 0.0;  ///< [s] duration of Ingest::run()
  /// Names of links for which nothing in it is an obstacle: ProximityQuery and what rests on it
  /// leaves it out for them. Answers are kept by build: to be changed with `index` only.
  std::vector<std::string> not_for;

  /// Whether it holds obstacles for a link.
  bool is_for(const std::string& link) const {
    return std::find(not_for.begin(), not_for.end(), link) == not_for.end();
  }
};

/// The clouds and maps of one query, in the order of their sources.
using SnapshotSpan = Span<const CloudSnapshot* const>;

/// Hands the newest value from one writer thread to one reader thread without locks (triple
/// buffering): the writer owns one slot, the reader another, and the third is exchanged between
/// them. Neither side ever waits, allocates or frees; values are overwritten in place, by the
/// writer only.
template <typename T>
class SnapshotChannel {
 public:
  /// Writer: the slot to fill next. It holds an old value, so that its buffers can be reused.
  T& back() { return slots_[back_]; }

  /// Writer: makes back() the newest value.
  void publish() {
    // Releases the writes to the slot, and acquires the slot that comes back, which the reader has
    // given up.
    const std::uint8_t fresh = back_ | kFresh;
    back_ = waiting_.exchange(fresh, std::memory_order_acq_rel) & kIndex;
  }

  /// Writer: the slot that waits for the reader, where the reader has taken its value before: it is
  /// the writer's too until the next publish(). Null: it holds the newest value, not taken yet.
  T* waiting() {
    // Acquires the slot, which the reader has given up.
    const std::uint8_t waiting = waiting_.load(std::memory_order_acquire);
    return (waiting & kFresh) == 0 ? &slots_[waiting & kIndex] : nullptr;
  }

  /// Reader: takes the newest value. @returns false when none was published since the last call
  bool update() {
    // Relaxed: a value published right now is taken next time, and the exchange below orders all.
    if ((waiting_.load(std::memory_order_relaxed) & kFresh) == 0) return false;
    front_ = waiting_.exchange(front_, std::memory_order_acq_rel) & kIndex;
    return true;
  }

  /// Reader: the value taken last (default constructed before the first update).
  const T& front() const { return slots_[front_]; }
  /// Reader: the same, for the reader to change.
  T& front() { return slots_[front_]; }

 private:
  static constexpr std::uint8_t kIndex = 3, kFresh = 4;
  static_assert(std::atomic<std::uint8_t>::is_always_lock_free, "neither side may wait");

  // One cache line each, so that the threads do not slow each other down.
  static constexpr std::size_t kCacheLine = 64;

  std::array<T, 3> slots_{};
  alignas(kCacheLine) std::uint8_t back_ = 0;                 // writer's
  alignas(kCacheLine) std::atomic<std::uint8_t> waiting_{1};  // index, and whether it is fresh
  alignas(kCacheLine) std::uint8_t front_ = 2;                // reader's
};

}  // namespace ist
