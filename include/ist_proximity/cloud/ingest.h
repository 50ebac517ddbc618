#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <memory>

#include "ist_proximity/cloud/cloud_layout.h"
#include "ist_proximity/cloud/cloud_snapshot.h"
#include "ist_proximity/geometry/span.h"
#include "ist_proximity/tree/posed_solid.h"

namespace ist {

/// The choice of the points of a cloud that are kept.
struct IngestConfig {
  double min_range = 0.05;            ///< [m] from the sensor; >= 0
  double max_range = 3.0;             ///< [m] from the sensor; > min_range, may be inf
  bool self_filter = true;            ///< drop points on the robot
  double self_filter_padding = 0.02;  ///< [m] >= 0: points at most this far from a link are dropped
  /// Make the thinned cloud; without it repulsion and contact volumes see no points.
  bool thin = true;
  double thinning = 0.01;  ///< [m] > 0: edge of a voxel of the thinned cloud
};

/// Turns raw clouds into snapshots. Keeps its working memory, so a steady stream does not
/// allocate. Not thread safe: one Ingest per source and thread.
class Ingest {
 public:
  /// @throws std::invalid_argument naming the member and its value, when one is out of its range.
  explicit Ingest(const IngestConfig& config);
  ~Ingest();
  Ingest(Ingest&&) noexcept;
  Ingest& operator=(Ingest&&) noexcept;

  /// Sets the region of interest from the next cloud on; at first there is none.
  /// @throws std::invalid_argument when it is not a sphere; the last one stays then
  void set_region_of_interest(const RegionOfInterest& region);

  /// Drops points that are not finite, out of range or outside the region of interest, moves the
  /// rest to the fixed frame in double, removes the robot's own points and builds the index. The
  /// index's origin lies on whole metres at the sensor, or in the middle of a cloud that is far
  /// from its sensor's frame (map coordinates); it is subtracted before double becomes float.
  ///
  /// A point is the robot's when its exact distance to one of the solids is at most the padding, or
  /// when it is inside one.
  /// @param cloud  checked by check_layout; points in the sensor frame S
  /// @param X_FS   sensor frame -> fixed frame, rigid
  /// @param robot  the robot's links at the cloud's stamp, see posed_solids(); for a measurement
  ///               that takes its time (a scan), at several instants: a point that is the robot's
  ///               at any of them is dropped. Empty: no self-filter
  /// @param stamp  [s]
  /// @param snapshot  overwritten, its buffers reused
  /// @throws std::invalid_argument when X_FS is not finite; the snapshot is as before then
  void run(const RawCloud& cloud, const Eigen::Isometry3d& X_FS, Span<const PosedSolid> robot,
           double stamp, CloudSnapshot* snapshot);

  const IngestConfig& config() const;  ///< the one given to the constructor

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace ist
