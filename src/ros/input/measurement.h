#pragma once

#include <ros/node_handle.h>
#include <ros/subscriber.h>
#include <ros/time.h>
#include <sensor_msgs/LaserScan.h>
#include <std_msgs/Header.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/cloud/laser_scan.h"
#include "ist_proximity/tree/inner_sphere_tree.h"
#include "ros/parameters/source_config.h"

namespace ist {

/// The poses of sensor and robot while something was measured.
struct Placement {
  Eigen::Isometry3d X_FS = Eigen::Isometry3d::Identity();      ///< sensor at the first instant
  Eigen::Isometry3d X_FS_end = Eigen::Isometry3d::Identity();  ///< sensor at the last instant
  /// For the self-filter: links whose poses are known at all instants, at each of the instants.
  std::vector<PosedSolid> robot;
  /// By element of `robot`: the first and the last instant for which it stands.
  std::vector<std::pair<std::size_t, std::size_t>> robot_instants;
  std::vector<double> paddings;  ///< [m] by element of `robot`; empty: the usual one
  std::vector<bool> known;       ///< by link: at every instant; empty: no self-filter
};

/// One checked message, whatever its type: it knows the instants whose transforms are needed, and
/// turns itself into a snapshot. Immutable; it keeps the message alive.
class Measurement {
 public:
  /// @param bytes  what it keeps in memory, about
  Measurement(const std_msgs::Header& header, std::size_t bytes)
      : header_(header), received_(ros::Time::now()), bytes_(bytes) {}
  virtual ~Measurement() = default;
  Measurement(const Measurement&) = delete;
  Measurement& operator=(const Measurement&) = delete;

  const std_msgs::Header& header() const { return header_; }
  /// The instant from which its age counts: its stamp, or its receipt where the stamp was ahead of
  /// the clock.
  ros::Time counts_from() const { return std::min(header_.stamp, received_); }
  /// The memory that it keeps, about [bytes].
  std::size_t bytes() const { return bytes_; }

  /// The instants, in order, at which the poses of sensor and robot must be known, the stamp first:
  /// several for a scan, which takes its time, and none for a map, which stays in its own frame.
  virtual std::vector<ros::Time> instants() const { return {header_.stamp}; }

  /// The points of the message, as long as this lives; null: it has none, or they were measured
  /// from several places. A memory needs them.
  virtual const RawCloud* raw_cloud() const { return nullptr; }

  /// Makes the snapshot.
  /// @param placement  the poses at instants()
  /// @param snapshot   overwritten, its buffers reused
  /// @throws std::exception when there is not enough memory
  virtual void ingest(const Placement& placement, Ingest* ingest,
                      CloudSnapshot* snapshot) const = 0;

 private:
  std_msgs::Header header_;
  ros::Time received_;
  std::size_t bytes_;
};

/// A received message: its header, and either a sentence about its fault or a measurement.
struct Received {
  std_msgs::Header header;
  std::string fault;
  std::shared_ptr<const Measurement> measurement;
  std::string doubt = {};     ///< a sentence about a message that is used all the same
  std::uint64_t content = 0;  ///< equal for messages of the same bytes; 0: not asked
};
using Receiver = std::function<void(const Received&)>;
/// Called before a message is read, which takes long for a large map.
using ReadingBegins = std::function<void()>;

/// Reads a LaserScan. Each beam is placed with the sensor's pose at the beam's own time, and the
/// self-filter uses the robot's poses at several instants of the scan.
/// @param ranges  its min_range, max_range and sensor_range apply to each beam
Received read_scan(const sensor_msgs::LaserScanConstPtr& message, const IngestConfig& ranges,
                   const ScanLimits& limits);

/// [m] The extent of a map's boxes.
double map_extent(const SourceConfig& config);

/// [m] No obstacle of the source has a larger extent.
double largest_extent(const SourceConfig& config);

/// The configuration of a source's Ingest. The range limits of scans apply to beams instead.
IngestConfig ingest_config(const SourceConfig& config);

/// The topics of a source.
struct Subscription {
  ros::Subscriber messages;
  ros::Subscriber camera_info;  ///< of depth images
};

/// Subscribes to the source's topic with its message type.
/// @param begin, receive  called from the callback queue of the node handle
Subscription subscribe(const SourceConfig& config, ros::NodeHandle* nh, const ReadingBegins& begin,
                       const Receiver& receive);

}  // namespace ist
