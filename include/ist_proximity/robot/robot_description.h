#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "ist_proximity/geometry/shapes.h"

namespace ist {

/// The kinds of joints of a URDF.
enum class JointType { kFixed, kRevolute, kContinuous, kPrismatic, kPlanar, kFloating };

/// A joint that follows another: its position is multiplier * (that one's) + offset.
struct Mimic {
  std::string joint;        ///< name of the joint that is followed
  double multiplier = 1.0;  ///< ratio of the two joints' units (1, rad/m or m/rad)
  double offset = 0.0;      ///< [rad, m]
};

/// A joint as the URDF states it.
struct JointDescription {
  std::string name;                                        ///< name in the URDF
  JointType type = JointType::kFixed;                      ///< kind of the joint
  std::string parent_link;                                 ///< name of the link P
  std::string child_link;                                  ///< name of the link that it moves
  Eigen::Isometry3d X_PJ = Eigen::Isometry3d::Identity();  ///< joint frame J -> parent link P
  Eigen::Vector3d axis = Eigen::Vector3d::UnitX();         ///< in J; any length but 0
  std::optional<Mimic> mimic;                              ///< empty: it follows no other joint
  /// [rad, m] lower limit; -inf where the joint has none
  double lower = -std::numeric_limits<double>::infinity();
  /// [rad, m] upper limit; +inf where the joint has none
  double upper = std::numeric_limits<double>::infinity();
  /// [rad/s, m/s] limit; +inf where the joint has none, or 0
  double speed = std::numeric_limits<double>::infinity();
};

/// The elements of a URDF that a link's shapes are read from.
enum class GeometrySource { kCollision, kVisual };

/// A link of the URDF with the exact shapes it is made of.
struct LinkDescription {
  std::string name;          ///< name in the URDF
  LinkGeometry geometry;     ///< empty when `error` is set
  std::string error;         ///< why there is no geometry: element, file, value, what to do
  std::size_t attached = 0;  ///< how many elements, at the end of `geometry`, are attached objects
  bool used_visual_fallback = false;  ///< collision was asked for, and there is only visual
};

/// The content of a URDF that the library uses: names and shapes, in the order of the document.
struct RobotDescription {
  std::string name;                                 ///< name of the robot
  std::string root_link;                            ///< the link that is no joint's child
  std::vector<LinkDescription> links;               ///< links that have geometry
  std::vector<std::string> links_without_geometry;  ///< names of the other links
  std::vector<std::string> link_order;              ///< every link, with geometry or without
  std::vector<JointDescription> joints;             ///< every joint
};

/// The folder of a ROS package, or an empty string when it is not known.
using PackageFinder = std::function<std::string(const std::string& package)>;

/// Searches ROS_PACKAGE_PATH as rospack does (folders with a package.xml of that name), without
/// ROS.
PackageFinder environment_package_finder();

/// Called before a mesh is read, with the names of its link and its file, and every few
/// milliseconds while it is read. Returning false ends the reading of the URDF. Meshes are read on
/// several threads: it is called from any of them, one call at a time.
using ReadingProgress = std::function<bool(const std::string& link, const std::string& mesh)>;

/// Reads a URDF (urdfdom) and the meshes it names (assimp).
///
/// A link whose geometry is faulty stays in `links` with its `error`; the others are read. Lengths,
/// positions and scales are at most 10 km (10000), mesh files at most 256 MB.
/// @param progress  may be empty
/// @throws ModelError when the text is no URDF: empty, not XML, no `<robot>`, no link, joints that
///         form no tree; names that hold control characters; more than 5000 links; or when
///         `progress` ended it
RobotDescription parse_urdf(const std::string& urdf_xml, GeometrySource source,
                            const PackageFinder& find_package,
                            const ReadingProgress& progress = {});

}  // namespace ist
