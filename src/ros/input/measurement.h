#pragma once

#include <ros/node_handle.h>
#include <ros/subscriber.h>
#include <std_msgs/Header.h>

#include <Eigen/Geometry>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/tree/posed_solid.h"
#include "ros/parameters/parameters.h"

namespace ist {

/// Where sensor and robot were while something was measured.
struct Placement {
  Eigen::Isometry3d X_FS = Eigen::Isometry3d::Identity();      ///< sensor at the first instant
  Eigen::Isometry3d X_FS_end = Eigen::Isometry3d::Identity();  ///< and at the last one
  std::vector<PosedSolid> robot;  ///< links of known pose at all instants, for the self-filter
  std::vector<bool> known;        ///< by link: at every instant; empty: no self-filter
};

/// One message, checked, whatever its type: what a source has to know to wait for its transforms,
/// and how it becomes a snapshot. Immutable; keeps the message alive.
class Measurement {
 public:
  explicit Measurement(const std_msgs::Header& header) : header_(header) {}
  virtual ~Measurement() = default;
  Measurement(const Measurement&) = delete;
  Measurement& operator=(const Measurement&) = delete;

  const std_msgs::Header& header() const { return header_; }

  /// The instants, in order, at which sensor and robot have to be known: the stamp first. More than
  /// one for what takes its time to measure, none for what stays in its own frame.
  virtual std::vector<ros::Time> instants() const { return {header_.stamp}; }

  /// @throws std::exception when there is not enough memory
  virtual void ingest(const Placement& placement, Ingest* ingest,
                      CloudSnapshot* snapshot) const = 0;

 private:
  std_msgs::Header header_;
};

/// What comes in: a header, and either a sentence with what is wrong or a measurement.
struct Received {
  std_msgs::Header header;
  std::string fault;
  std::shared_ptr<const Measurement> measurement;
};
using Receiver = std::function<void(const Received&)>;

/// What the source's Ingest is to look for: range limits only where the points know no better.
IngestConfig ingest_config(const SourceConfig& config);

/// Subscribes to the source's topic with its type.
/// @param receive  called from the queue of the node handle
ros::Subscriber subscribe(const SourceConfig& config, ros::NodeHandle* nh, const Receiver& receive);

}  // namespace ist
