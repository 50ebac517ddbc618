#pragma once

#include <ist_proximity/ProximityArray.h>
#include <ros/time.h>

#include <cstddef>
#include <string>
#include <vector>

#include "ist_proximity/robot/robot_model.h"
#include "ros/input/source.h"
#include "ros/model/model_state.h"
#include "ros/poses/pose_source.h"
#include "ros/status/cycle_report.h"
#include "ros/status/status.h"

namespace ist {

/// Fills the status, its text and the sources of a message.
void fill_status(const StatusInput& input, const Status& status,
                 ist_proximity::ProximityArray* message);

/// Lists what is found of a model whose robot is known, or not yet.
Findings model_findings(const ModelState& model);

/// Fills the whole message while there is no model: MODEL_ERROR or LOADING, and every link UNKNOWN.
void fill_without_model(const ModelState& model, const ServerConfig& config, const ros::Time& now,
                        const CloudSources& sources, ist_proximity::ProximityArray* message,
                        CycleReport* report);

/// Describes the links without a pose: one sentence with the first link's reason and the source's
/// hint, and one that names the others. Empty when all monitored links have poses.
/// @param source  of the poses; may be null
std::vector<std::string> missing_poses(const RobotModel& robot,
                                       const std::vector<std::size_t>& monitored,
                                       const StampedLinkPoses& poses, const PoseSource* source);

/// Names the links with a pose whose own points are still in a cloud, because the self-filter had
/// no pose for them at the cloud's stamp; empty when there are none. Says so where the poses are
/// older than the cloud.
/// @param pose_source  of the poses; may be null
std::string unfiltered_links(const RobotModel& robot, const std::vector<std::size_t>& monitored,
                             const StampedLinkPoses& poses, const PoseSource* pose_source,
                             const SourceSnapshot& snapshot, const std::string& source);

}  // namespace ist
