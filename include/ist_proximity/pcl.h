#pragma once

// Clouds of PCL as obstacles, where they lie in memory, and results as clouds of PCL. Header only:
// a program that includes it links pcl_common; this library needs no PCL.
//
//     const auto obstacles = ist::to_obstacles(cloud);  // a pcl::PointCloud, or a pointer to one
//     const auto answers = robot.distances(q, obstacles);
//     pcl::io::savePCDFileBinary("witnesses.pcd", ist::witness_points(answers));

#include <pcl/PCLPointCloud2.h>
#include <pcl/point_cloud.h>
#include <pcl/point_types.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/facade/obstacles.h"
#include "ist_proximity/proximity/proximity_query.h"

namespace ist {

/// Points of a PCL cloud where they lie, as Ingest::run() takes them.
struct PclView {
  RawCloud points;  ///< [m] in the sensor's frame S
  /// S -> frame Q, in which PCL states the sensor's origin and orientation. Identity unless a PCD
  /// file or a driver has set them.
  Eigen::Isometry3d X_QS = Eigen::Isometry3d::Identity();
};

/// The pose that PCL gives a cloud's sensor: frame S -> Q.
/// @throws std::invalid_argument when it is not finite, or the quaternion is not of length 1
inline Eigen::Isometry3d sensor_pose(const Eigen::Vector4f& origin,
                                     const Eigen::Quaternionf& orientation) {
  const Eigen::Quaterniond q = orientation.cast<double>();
  const Eigen::Vector3d p = origin.head<3>().cast<double>();
  if (!p.allFinite() || !(std::abs(q.norm() - 1.0) < 1e-3)) {
    std::ostringstream text;
    text << "a cloud's sensor_origin_ is (" << p.transpose() << ") m and its sensor_orientation_ "
         << "has the length " << q.norm() << ": they are no position and unit quaternion.";
    throw std::invalid_argument(text.str());
  }
  return Eigen::Translation3d(p) * q.normalized();
}

/// Views a cloud, organized or not, without a copy; it stays as it is while the view is in use.
/// @tparam PointT  any point with x, y and z, all float or all double
/// @throws std::invalid_argument when width * height is not the number of points, or as
///         sensor_pose()
template <class PointT>
PclView view(const pcl::PointCloud<PointT>& cloud) {
  using Scalar = std::remove_cv_t<decltype(PointT::x)>;
  static_assert(std::is_same_v<Scalar, float> || std::is_same_v<Scalar, double>,
                "whole numbers have no unit");
  if (std::size_t{cloud.width} * cloud.height != cloud.points.size()) {
    throw std::invalid_argument("a cloud of " + std::to_string(cloud.points.size()) +
                                " points has width " + std::to_string(cloud.width) + " * height " +
                                std::to_string(cloud.height) +
                                ": set both when points are added to `points` itself.");
  }
  PclView result;
  result.X_QS = sensor_pose(cloud.sensor_origin_, cloud.sensor_orientation_);
  if (cloud.points.empty()) return result;
  const PointT& first = cloud.points[0];
  const auto offset = [&](const Scalar& coordinate) {
    return static_cast<std::size_t>(
        std::distance(reinterpret_cast<const std::uint8_t*>(&first),
                      reinterpret_cast<const std::uint8_t*>(&coordinate)));
  };
  RawCloud& raw = result.points;
  raw.data = reinterpret_cast<const std::uint8_t*>(&first);
  raw.width = cloud.width;
  raw.height = cloud.height;
  raw.point_step = sizeof(PointT);
  raw.row_step = raw.width * sizeof(PointT);
  raw.x = offset(first.x);
  raw.y = offset(first.y);
  raw.z = offset(first.z);
  raw.is_double = std::is_same_v<Scalar, double>;
  return result;
}

/// The same of a cloud whose fields are known at run time: x, y and z, all float32 or all float64.
/// @throws std::invalid_argument naming the field or the sizes that do not fit (check_layout), or
///         as sensor_pose()
inline PclView view(const pcl::PCLPointCloud2& cloud,
                    const Eigen::Vector4f& origin = Eigen::Vector4f::Zero(),
                    const Eigen::Quaternionf& orientation = Eigen::Quaternionf::Identity()) {
  thread_local CloudLayout layout;  // keeps its memory: the next view allocates nothing
  layout.fields.resize(cloud.fields.size());
  for (std::size_t i = 0; i < cloud.fields.size(); ++i) {
    const pcl::PCLPointField& field = cloud.fields[i];
    layout.fields[i].name = field.name;
    layout.fields[i].offset = field.offset;
    layout.fields[i].datatype = field.datatype;
    layout.fields[i].count = field.count;
  }
  layout.width = cloud.width;
  layout.height = cloud.height;
  layout.point_step = cloud.point_step;
  layout.row_step = cloud.row_step;
  layout.is_bigendian = cloud.is_bigendian != 0;
  layout.data = cloud.data.data();
  layout.data_size = cloud.data.size();
  PclView result;
  const std::string fault = check_layout(layout, &result.points);
  if (!fault.empty()) throw std::invalid_argument("malformed cloud: " + fault);
  result.X_QS = sensor_pose(origin, orientation);
  return result;
}

/// Views a cloud by a pointer that shares it (std's or boost's), and keeps it: points of an
/// organized cloud are read when a query first needs them.
/// @throws std::invalid_argument when the pointer is null, or as the others
template <template <class> class Pointer, class Cloud>
PclView view(const Pointer<Cloud>& cloud) {
  if (!cloud) throw std::invalid_argument("there is no cloud: its pointer is null.");
  PclView result = view(*cloud);
  result.points.owner = std::shared_ptr<const void>(cloud.get(), [cloud](const void*) {});
  return result;
}

/// Obstacles of a cloud, or of a pointer to it, without a copy of its points. `X_FS` of the
/// settings is the pose of frame Q (PclView::X_QS); ranges count from the sensor.
/// @throws std::invalid_argument as view() and Obstacles::from_cloud()
template <class Cloud>
Obstacles to_obstacles(const Cloud& cloud, const ObstaclesConfig& config = {}) {
  const PclView seen = view(cloud);
  ObstaclesConfig placed = config;
  placed.X_FS = config.X_FS * seen.X_QS;
  return Obstacles::from_cloud(seen.points, placed);
}

/// The points of a cloud with the given numbers, with all their fields, in the cloud's own frame.
/// @param indices  below the number of points, such as Obstacles::indices()
template <class PointT>
pcl::PointCloud<PointT> select_points(const pcl::PointCloud<PointT>& cloud,
                                      const std::vector<std::uint32_t>& indices) {
  pcl::PointCloud<PointT> result;
  result.header = cloud.header;
  result.sensor_origin_ = cloud.sensor_origin_;
  result.sensor_orientation_ = cloud.sensor_orientation_;
  result.points.reserve(indices.size());
  for (const std::uint32_t i : indices) result.points.push_back(cloud.points.at(i));
  result.width = static_cast<std::uint32_t>(result.points.size());
  result.height = 1;
  return result;
}

/// The points that to_obstacles() uses of this cloud, with all their fields.
/// @param obstacles  made of it
template <class PointT>
pcl::PointCloud<PointT> used_points(const pcl::PointCloud<PointT>& cloud,
                                    const Obstacles& obstacles) {
  return select_points(cloud, obstacles.indices());
}

/// The points that the self-filter of these settings takes for the robot's, with all their fields.
/// It indexes the cloud twice: for pictures, not for a control loop.
/// @throws std::invalid_argument as to_obstacles()
template <class PointT>
pcl::PointCloud<PointT> points_on_robot(const pcl::PointCloud<PointT>& cloud,
                                        const ObstaclesConfig& config) {
  ObstaclesConfig unfiltered = config;
  unfiltered.robot = nullptr;
  const std::vector<std::uint32_t> all = to_obstacles(cloud, unfiltered).indices(),
                                   used = to_obstacles(cloud, config).indices();
  std::vector<std::uint32_t> on_robot;
  std::set_difference(all.begin(), all.end(), used.begin(), used.end(),
                      std::back_inserter(on_robot));
  return select_points(cloud, on_robot);
}

/// The closest points of each link that is NEAR or in CONTACT, and of its obstacle, in the fixed
/// frame: two rows, the first of points on links, the second of those on obstacles.
inline pcl::PointCloud<pcl::PointXYZ> witness_points(Span<const LinkProximity> answers) {
  pcl::PointCloud<pcl::PointXYZ> result;
  const auto add = [&](const Eigen::Vector3d& p) {
    const Eigen::Vector3f q = p.cast<float>();
    result.points.emplace_back(q.x(), q.y(), q.z());
  };
  const auto has_witness = [](const LinkProximity& one) {
    return one.state == LinkState::kNear || one.state == LinkState::kContact;
  };
  for (const LinkProximity& one : answers) {
    if (has_witness(one)) add(one.p_FCl);
  }
  result.width = static_cast<std::uint32_t>(result.points.size());
  result.height = 2;
  for (const LinkProximity& one : answers) {
    if (has_witness(one)) add(one.p_FCo);
  }
  return result;
}

}  // namespace ist
