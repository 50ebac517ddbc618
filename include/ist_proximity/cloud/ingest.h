#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <type_traits>
#include <vector>

#include "ist_proximity/cloud/cloud_snapshot.h"
#include "ist_proximity/cloud/point_extent.h"
#include "ist_proximity/cloud/view_filter.h"
#include "ist_proximity/cloud/zone.h"
#include "ist_proximity/geometry/span.h"
#include "ist_proximity/tree/inner_sphere_tree.h"

namespace ist {

/// One field of a point, as sensor_msgs/PointField describes it.
struct RawField {
  std::string name;           ///< "x", "y" and "z" are read
  std::uint32_t offset = 0;   ///< [bytes] from the start of the point
  std::uint8_t datatype = 0;  ///< 7: float32, 8: float64
  std::uint32_t count = 1;    ///< numbers in the field
};

/// The description that a message gives of its own bytes (the members of sensor_msgs/PointCloud2).
struct CloudLayout {
  std::vector<RawField> fields;        ///< fields of each point
  std::uint32_t width = 0;             ///< points in a row
  std::uint32_t height = 0;            ///< rows
  std::uint32_t point_step = 0;        ///< [bytes] from a point to the next
  std::uint32_t row_step = 0;          ///< [bytes] from a row to the next
  bool is_bigendian = false;           ///< byte order of the numbers
  const std::uint8_t* data = nullptr;  ///< not owned
  std::size_t data_size = 0;           ///< [bytes]
};

/// The numbers of a depth image, one a pixel; see depth_image.h.
enum class DepthType : std::uint8_t {
  kNone,     ///< a cloud
  kUint16,   ///< [mm]
  kFloat32,  ///< [m]
};
struct DepthRays;

/// The points of a message: where x, y and z lie in its bytes, or the rays that they lie on.
/// Checked once (check_layout, check_depth_image), so that reading needs no checks.
struct RawCloud {
  const std::uint8_t* data = nullptr;     ///< the first point; not owned
  std::size_t width = 0;                  ///< points in a row
  std::size_t height = 0;                 ///< rows
  std::size_t point_step = 0;             ///< [bytes] from a point to the next
  std::size_t row_step = 0;               ///< [bytes] from a row to the next
  std::size_t x = 0;                      ///< [bytes] offset of x within a point
  std::size_t y = 0;                      ///< [bytes] offset of y within a point
  std::size_t z = 0;                      ///< [bytes] offset of z within a point
  bool is_double = false;                 ///< float64 coordinates, else float32
  bool swap_bytes = false;                ///< the data's byte order is not the machine's
  DepthType depth = DepthType::kNone;     ///< of a depth image, which has no x, y and z
  std::shared_ptr<const DepthRays> rays;  ///< of a depth image's pixels
  double pixel_angle = 0.0;   ///< [rad] largest angle between two neighbours; 0: not known
  double depth_unit = 0.001;  ///< [m] a depth image's number of 1
  /// [m] In the frame of the points, the place that they are relative to: from there the sensor
  /// looks. Zero but for a depth image with a baseline.
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  /// Each point is a range along a ray from the origin (depth images and scans). An infinite one
  /// means that nothing is in range, and one at the origin that nothing was measured.
  bool from_rays = false;
  double sensor_moved = 0.0;  ///< [m] the origin's largest way while the points were measured
  /// [m] Farther points were not measured, whatever IngestConfig says.
  double believed_range = std::numeric_limits<double>::infinity();
  /// `data` stays unchanged as long as this lives, so that points may be read later, when a query
  /// needs them. Null: `data` is valid during the call only, and all points are read then.
  std::shared_ptr<const void> owner;

  /// Points in the cloud, those that are not finite included.
  std::size_t size() const { return width * height; }
};

/// Views points that lie one after the other in memory, such as an array (height, width, 3).
/// @param data     x of the first point; its y and z follow. Not owned: see RawCloud::owner
/// @param width    points in a row
/// @param height   rows; 1 for a list
/// @param numbers  from a point to the next, at least 3; those after z are not read
template <class Scalar>
RawCloud packed_cloud(const Scalar* data, std::size_t width, std::size_t height,
                      std::size_t numbers = 3) {
  static_assert(std::is_same_v<Scalar, float> || std::is_same_v<Scalar, double>);
  RawCloud cloud;
  cloud.data = reinterpret_cast<const std::uint8_t*>(data);
  cloud.width = width;
  cloud.height = height;
  cloud.point_step = numbers * sizeof(Scalar);
  cloud.row_step = width * cloud.point_step;
  cloud.y = sizeof(Scalar);
  cloud.z = 2 * sizeof(Scalar);
  cloud.is_double = std::is_same_v<Scalar, double>;
  return cloud;
}

/// The choice of the points of a cloud that are kept.
struct IngestConfig {
  double min_range = 0.05;  ///< [m] from the sensor; >= 0
  double max_range = 3.0;   ///< [m] from the sensor; > min_range, may be inf
  /// [m] > 0, may be inf: the most that the sensor can measure. Points farther than this, and than
  /// max_range, are not believed, as in another unit: IngestCounts::measured() leaves them out.
  double sensor_range = std::numeric_limits<double>::infinity();
  /// [m] >= 0. Queries look no farther than this from where the robot is while the cloud is used;
  /// infinity: anywhere. The points of an unorganized cloud that are farther away, or behind nearer
  /// ones, are indexed coarsely, which takes less time. Queries that look there all the same
  /// find the same, more slowly.
  double search_distance = std::numeric_limits<double>::infinity();
  bool self_filter = true;            ///< drop points on the robot
  double self_filter_padding = 0.02;  ///< [m] >= 0: points at most this far from a link are dropped
  SelfFilterMode self_filter_mode = SelfFilterMode::kPadding;  ///< how the robot is recognised
  ViewFilterConfig view;  ///< used where self_filter_mode is kView
  /// Give the cloud a thinned one; without it repulsion and contact volumes see no points. It costs
  /// nothing until they look at a part of the cloud, which is thinned then, once.
  bool thin = true;
  double thinning = 0.01;  ///< [m] at least 1e-9: edge of a voxel of the thinned cloud
  /// Radius of a point, for lower bounds that hold for the surface in place of its samples.
  ExtentConfig extent;
  /// >= 1: a cloud of more points is refused. This bounds time and memory of one cloud: five
  /// million points take about 3 s and 700 MB where neighbours in the message lie anywhere in
  /// space.
  std::size_t max_points = 5000000;
};

/// Checks a layout: x, y and z are there once, all float32 or all float64, with one value each,
/// inside the point and without overlap; the sizes agree with each other and with the data. Other
/// fields are ignored. Nothing overflows, whatever the sizes.
///
/// An empty cloud (width or height 0) is valid, as a measurement of nothing, where it does not
/// contradict itself: it has the fields x, y and z and no data. It may leave out point_step and
/// row_step. An empty cloud without these fields, or with data, is faulty.
///
/// Tolerated are a row_step of 0 in a cloud of one row, where it can only mean width * point_step,
/// and bytes after the last row.
/// @param cloud       filled when the layout is valid, else unchanged; an empty cloud has width and
///                    height 0
/// @param max_points  a cloud of more points is faulty
/// @returns an empty string, or one sentence with the faulty field and its values. Thread safe.
std::string check_layout(const CloudLayout& layout, RawCloud* cloud,
                         std::size_t max_points = IngestConfig().max_points);

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

  /// Sets the zones from the next cloud on; at first there are none. Points of other groups than
  /// the one that is kept are left out, whole surfaces only: a point is in a zone when the sphere
  /// that it stands for is (CloudSnapshot::extent). Of several zones that hold it, the first one
  /// counts. Each point is kept for one group at least; what rounding leaves open, for two.
  /// @param kept  a group, or Zone::kNone: the points that are in no zone
  void set_zones(const std::vector<Zone>& zones, std::size_t kept = Zone::kNone);

  /// Drops points that are not finite, out of range or outside the region of interest, moves the
  /// rest to the fixed frame in double, removes the robot's own points and builds the index. The
  /// index's origin lies on whole metres at the sensor, or in the middle of a cloud that is far
  /// from its sensor's frame (map coordinates); it is subtracted before double becomes float.
  ///
  /// A point is the robot's when its exact distance to one of the solids is at most the padding, or
  /// when it is inside one. With SelfFilterMode::kView, those of them that the sensor cannot see
  /// where the robot is are kept, and X_FS is corrected by what the points on the robot say of it
  /// (CloudSnapshot::view).
  /// @param cloud  checked by check_layout; points in the sensor frame S
  /// @param X_FP   frame of the cloud's points -> fixed frame, rigid: that of S, whose origin is at
  ///               RawCloud::origin in the points' frame
  /// @param robot  the robot's links at the cloud's stamp, see posed_solids(); for a measurement
  ///               that takes its time (a scan), at several instants: a point that is the robot's
  ///               at any of them is dropped. Empty: no self-filter
  /// @param stamp  [s]
  /// @param snapshot  overwritten, its buffers reused
  /// @param paddings  [m] >= 0, by element of `robot`: with SelfFilterMode::kPadding, in place of
  ///                  self_filter_padding. Empty: none
  /// @throws std::invalid_argument when X_FP is not finite or farther than 10^9 m from the origin,
  /// or
  ///         the cloud has more than max_points; the snapshot is as before then
  void run(const RawCloud& cloud, const Eigen::Isometry3d& X_FP, Span<const PosedSolid> robot,
           double stamp, CloudSnapshot* snapshot, Span<const double> paddings = {});

  const IngestConfig& config() const;  ///< the one given to the constructor

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace ist
