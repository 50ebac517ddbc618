#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <string>

#include "internal/geometry/limits.h"
#include "internal/proximity/planning_scene.h"
#include "proximity/wire_reader.h"

/// Fields that the parts of a moveit_msgs/PlanningScene share. They throw WireError where the bytes
/// end too early.
namespace ist {

constexpr std::size_t kPoseSize = 56;  ///< [bytes]
/// Longer names are no names, and are cut here.
constexpr std::size_t kNameBuffer = kMaxNameSize + 1;

/// Notes a fault unless there is one: the first one counts.
void note(std::string* fault, const std::string& text);

/// Reads a geometry_msgs/Pose. A quaternion of zeros is the identity, as in MoveIt.
/// @param what   the subject of a fault
/// @param fault  receives why it is no pose, which is the identity then
Eigen::Isometry3d read_pose(WireReader* in, const char* what, std::string* fault);

/// Reads a std_msgs/Header. @returns its frame_id
std::string read_header_frame(WireReader* in);

/// Reads an octomap_msgs/OctomapWithPose. Data that is no octomap is the octomap's own fault.
/// @returns whether it says anything of an octomap: MoveIt names one that was cleared, without data
bool read_scene_octomap(WireReader* in, const OctreeLimits& limits, SceneOctomap* octomap);

}  // namespace ist
