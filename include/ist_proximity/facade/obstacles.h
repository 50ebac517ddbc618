#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/cloud/cloud_snapshot.h"
#include "ist_proximity/cloud/point_extent.h"
#include "ist_proximity/geometry/span.h"

namespace ist {

class Robot;
struct RawCloud;

/// The choice of the points that become obstacles.
struct ObstaclesConfig {
  /// Frame S of the points -> fixed frame; rigid.
  Eigen::Isometry3d X_FS = Eigen::Isometry3d::Identity();
  double min_range = 0.0;  ///< [m] >= 0: points nearer to the origin of S are dropped
  /// [m] > min_range: points farther from the origin of S are dropped
  double max_range = std::numeric_limits<double>::infinity();
  /// Self-filter: points on this robot at configuration `q` are dropped. Null: none.
  const Robot* robot = nullptr;
  std::vector<double> q;              ///< [rad, m] in the order of Robot::joints()
  double self_filter_padding = 0.02;  ///< [m] >= 0: points at most this far from a link are dropped
  /// Radius of a point, for lower bounds that hold for the surface in place of its samples; zero
  /// unless set. Where it grows with the range, max_range has to be finite.
  ExtentConfig extent;
};

/// Obstacle points, indexed for queries. Points that are not finite are dropped. An empty list
/// means that there are no obstacles; points of which none was measured (IngestCounts::measured())
/// do not. Immutable, cheap to copy (copies share the index), thread safe.
class Obstacles {
 public:
  /// A list of points [m] in frame S.
  /// @throws std::invalid_argument when a setting is out of its range, there are more than five
  ///         million points, or none of them was measured
  explicit Obstacles(Span<const Eigen::Vector3f> points, const ObstaclesConfig& config = {});
  /// The same in double.
  explicit Obstacles(Span<const Eigen::Vector3d> points, const ObstaclesConfig& config = {});

  /// An image of points, NaN where nothing was measured: indexed several times faster than a list.
  /// @param xyz     [m] in S, row by row: height * width * 3 numbers
  /// @param width   points in a row
  /// @param height  rows
  static Obstacles from_image(const float* xyz, std::size_t width, std::size_t height,
                              const ObstaclesConfig& config = {});
  /// The same in double.
  static Obstacles from_image(const double* xyz, std::size_t width, std::size_t height,
                              const ObstaclesConfig& config = {});

  /// Points where they lie in memory, with any layout: a view of a message or of another library's
  /// cloud (check_layout, packed_cloud, pcl.h). Nothing is copied. With RawCloud::owner the points
  /// of an image are read when a query first needs them; without, all are read now.
  static Obstacles from_cloud(const RawCloud& cloud, const ObstaclesConfig& config = {});

  /// Solid boxes of a map [m], axis-aligned in its frame M; they may overlap or touch.
  /// @param X_FM  frame M -> fixed frame, rigid
  /// @throws std::invalid_argument when a box is empty, a coordinate is not finite or not below
  ///         10^9 m, or X_FM is not rigid
  static Obstacles from_boxes(const std::vector<Eigen::AlignedBox3d>& boxes,
                              const Eigen::Isometry3d& X_FM = Eigen::Isometry3d::Identity());

  /// The points of a PCD or PLY file, by its extension (read_points). X_FS is its frame Q -> fixed
  /// frame; ranges count from its sensor.
  /// @throws ModelError when the file cannot be read
  static Obstacles from_file(const std::string& path, const ObstaclesConfig& config = {});

  std::size_t size() const { return snapshot_->counts.used; }  ///< points used
  /// Numbers of points by what was done with them.
  const IngestCounts& counts() const { return snapshot_->counts; }
  /// The numbers of the points used, ascending: in the list, or in the image row by row.
  std::vector<std::uint32_t> indices() const;
  const CloudSnapshot& snapshot() const { return *snapshot_; }  ///< what queries take

 private:
  explicit Obstacles(std::shared_ptr<const CloudSnapshot> snapshot);

  std::shared_ptr<const CloudSnapshot> snapshot_;  // not null
};

/// Points of a file.
struct PointFile {
  /// [m] in frame Q, in which a PCD file's VIEWPOINT is stated; NaN where nothing was measured.
  std::vector<Eigen::Vector3d> points;
  std::size_t width = 0;   ///< points in a row
  std::size_t height = 0;  ///< rows; 1: a list
  /// VIEWPOINT: frame S of the sensor -> Q.
  Eigen::Isometry3d X_QS = Eigen::Isometry3d::Identity();
};

/// Reads the points of a PCD file (ascii, binary, binary_compressed) or of a PLY file's element
/// "vertex" (ascii, binary of either byte order); other fields are ignored. Thread safe.
/// @throws ModelError naming the file, the place and what is wrong: not a regular file, over 1 GB,
///         cut off or longer than it says, no x, y and z, whole numbers for them (their unit is not
///         known), a VIEWPOINT that is no pose, an unknown line, more than five million points,
///         faces or edges, whose corners alone would leave the surface out, or a PLY file's camera
///         elsewhere than at the origin: whether points are stated in its frame is not known
PointFile read_points(const std::string& path);

}  // namespace ist
