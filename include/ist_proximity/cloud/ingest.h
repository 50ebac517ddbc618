#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <memory>
#include <vector>

#include "ist_proximity/cloud/cloud_snapshot.h"
#include "ist_proximity/cloud/raw_cloud.h"
#include "ist_proximity/robot/robot_model.h"

namespace ist {

/// What is kept of a cloud.
struct IngestConfig {
  double min_range = 0.05;            ///< [m] from the sensor; >= 0
  double max_range = 3.0;             ///< [m] from the sensor; > min_range, may be inf
  bool self_filter = true;            ///< drop points on the robot
  double self_filter_padding = 0.02;  ///< [m] >= 0: a point at most this far from a link is its own
  bool thin =
      true;  ///< make the thinned cloud; without it repulsion and contact volumes see nothing
  double thinning = 0.01;  ///< [m] > 0: cell of the thinned cloud that repulsion sums over
};

/// The robot at a cloud's own stamp, for the self-filter.
struct PosedRobot {
  const RobotModel* model = nullptr;    ///< null: no self-filter
  std::vector<Eigen::Isometry3d> X_FL;  ///< by link: link frame -> fixed frame
  std::vector<bool> known;              ///< by link: whether the pose is known
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

  /// Where to end from the next cloud on; nowhere at first.
  /// @throws std::invalid_argument when it is not a sphere; the last one stays then
  void set_region_of_interest(const RegionOfInterest& region);

  /// Drops what is not finite, out of range or beyond the region, moves the rest to the fixed
  /// frame in double, removes the robot's own points and builds the index. Its origin, on whole
  /// metres, is where the sensor is, or in the middle of a cloud that is far from its sensor's
  /// frame (map coordinates): it is subtracted before double becomes float.
  ///
  /// A point is the robot's when its exact distance to a link is at most the padding, or when it is
  /// inside. Links whose pose is unknown claim no point.
  /// @param cloud  checked by check_layout; points in the sensor frame S
  /// @param X_FS   sensor frame -> fixed frame, rigid
  /// @param robot  poses at the cloud's stamp
  /// @param stamp  [s]
  /// @param snapshot  overwritten, its buffers reused
  /// @param also   the robot at further instants, of a measurement that takes its time (a scan): a
  ///               point that is the robot's at any of them is dropped
  /// @throws std::invalid_argument when X_FS is not finite; the snapshot is as before then
  void run(const RawCloud& cloud, const Eigen::Isometry3d& X_FS, const PosedRobot& robot,
           double stamp, CloudSnapshot* snapshot, const std::vector<PosedRobot>& also = {});

  const IngestConfig& config() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace ist
