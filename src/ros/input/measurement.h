#pragma once

#include <ros/node_handle.h>
#include <ros/subscriber.h>
#include <ros/time.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/LaserScan.h>
#include <sensor_msgs/PointCloud2.h>
#include <std_msgs/Header.h>
#include <topic_tools/shape_shifter.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "internal/cloud/noise_filter.h"
#include "ist_proximity/cloud/depth_image.h"
#include "ist_proximity/cloud/ingest.h"
#include "ros/parameters/source_config.h"

namespace ist {

/// The poses of sensor and robot while something was measured.
struct Placement {
  Eigen::Isometry3d X_FS = Eigen::Isometry3d::Identity();  ///< sensor at the first instant
  std::vector<Eigen::Isometry3d> X_FS_at;                  ///< sensor at each instant
  /// For the self-filter: links whose poses are known at all instants, at each of the instants.
  std::vector<PosedSolid> robot;
  /// By element of `robot`: the first and the last instant for which it stands.
  std::vector<std::pair<std::size_t, std::size_t>> robot_instants;
  std::vector<double> paddings;  ///< [m] by element of `robot`; empty: the usual one
  std::vector<bool> known;       ///< by link: at every instant; empty: no self-filter
};

/// One message of a sensor or map, checked, whatever its type.
struct Measurement {
  std_msgs::Header header;
  std::string publisher;      ///< the node that has sent it; empty: it is of a file
  std::string fault;          ///< why it cannot be used; empty: it can
  std::string doubt;          ///< a sentence about a message that is used all the same
  std::uint64_t content = 0;  ///< equal for messages of the same bytes; 0: not asked
  std::size_t bytes = 0;      ///< that it keeps in memory, about
  /// The instants, in order, at which the poses of sensor and robot must be known, the stamp first:
  /// several for a scan, which takes its time, and none for a map, which stays in its own frame.
  std::vector<ros::Time> instants;
  /// The points of a message whose points were measured from one place. A memory needs them.
  RawCloud points;
  /// Makes the snapshot, whose buffers are used again, of the poses at the instants. Throws where
  /// there is not enough memory. It keeps alive what it needs of the message.
  std::function<void(const Placement&, Ingest*, CloudSnapshot*)> take_in;
  ros::Time received = ros::Time::now();

  /// The instant from which its age counts: its stamp, or its receipt where the stamp was ahead of
  /// the clock.
  ros::Time counts_from() const { return std::min(header.stamp, received); }
};

/// One that cannot be used.
Measurement faulty(const std_msgs::Header& header, const std::string& fault);

/// Points of one instant: a cloud, or the pixels of a depth image.
/// @param points  keep their message alive
/// @param bytes   of that message
/// @param noise   null: no noise filter
Measurement measure_points(const std_msgs::Header& header, const RawCloud& points,
                           std::size_t bytes, const std::shared_ptr<NoiseFilter>& noise);

Measurement read_cloud(const sensor_msgs::PointCloud2ConstPtr& message,
                       const std::shared_ptr<NoiseFilter>& noise);

/// Reads depth images with the newest calibration of their camera. Not thread safe.
class DepthCamera {
 public:
  /// @param topic  of the CameraInfo, resolved
  DepthCamera(const SourceConfig& config, std::string topic, std::shared_ptr<NoiseFilter> noise)
      : config_(config), topic_(std::move(topic)), noise_(std::move(noise)) {}

  void take(const sensor_msgs::CameraInfo& message);
  Measurement read(const sensor_msgs::ImageConstPtr& message) const;

 private:
  std::string fault(const std::string& frame_id) const;

  const SourceConfig config_;
  const std::string topic_;
  const std::shared_ptr<NoiseFilter> noise_;
  sensor_msgs::CameraInfo newest_;
  bool has_come_ = false;
  std::string fault_, doubt_;  ///< of the calibration
  std::shared_ptr<const DepthRays> rays_;
};

/// Each beam is placed with the sensor's pose at the beam's own time, and the self-filter uses the
/// robot's poses at several instants of the scan.
/// @param ranges  its min_range, max_range and sensor_range apply to each beam
Measurement read_scan(const sensor_msgs::LaserScanConstPtr& message, const IngestConfig& ranges,
                      const ScanLimits& limits);

/// Reads an octomap_msgs/Octomap from its bytes, so that the package of that message is not needed.
Measurement read_map(const topic_tools::ShapeShifter& message, const OctreeLimits& limits);
/// Reads a map file. The header of the result has no stamp.
Measurement read_map_file(const std::string& path, const std::string& frame_id,
                          const OctreeLimits& limits);

/// Advertises and publishes such a map, a binary tree.
/// @param data  as MemoryMap::octree_bytes() makes it
ros::Publisher advertise_map(ros::NodeHandle* nh, const std::string& topic);
void publish_map(const ros::Publisher& publisher, const std_msgs::Header& header, double resolution,
                 const std::vector<std::uint8_t>& data);

/// Makes a message of the points that queries see: x, y, z in float32 [m] in the fixed frame.
sensor_msgs::PointCloud2Ptr to_message(const CloudSnapshot& snapshot, const ros::Time& stamp,
                                       const std::string& fixed_frame);

/// [m] The extent of a map's boxes.
double map_extent(const SourceConfig& config);

/// [m] No obstacle of the source has a larger extent.
double largest_extent(const SourceConfig& config);

/// The configuration of a source's Ingest. The range limits of scans apply to beams instead.
IngestConfig ingest_config(const SourceConfig& config);

/// Subscribes to the source's topic with its message type, and then to what that needs.
/// @param receive  called from the callback queue of the node handle with a function that reads the
///                 message, which takes long for a large map
std::vector<ros::Subscriber> subscribe(
    const SourceConfig& config, ros::NodeHandle* nh,
    const std::function<void(const std::function<Measurement()>&)>& receive);

}  // namespace ist
