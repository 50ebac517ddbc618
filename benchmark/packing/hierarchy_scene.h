#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/proximity/proximity_query.h"
#include "packing/options.h"

/// Scenes for the table of hierarchies.
namespace ist::benchmark {

constexpr std::size_t kHierarchySteps = 1000;  ///< queries of a motion

/// A robot, its poses, and the clouds about it.
struct HierarchyScene {
  std::shared_ptr<const RobotModel> model;
  std::vector<CloudSnapshot> clouds;
  std::vector<std::vector<Eigen::Isometry3d>> poses;  ///< by pose and link
  std::vector<std::vector<std::vector<bool>>> known;  ///< by cloud, pose and link: out of contact
};

/// The configuration of all queries.
QueryConfig hierarchy_query_config();

/// @param name  begins with "Panda", "demo" or "synthetic"; with the word "motion" the poses are a
///              motion at 1 kHz, else they are unrelated
/// @returns false without the data that the scene needs
bool make_hierarchy_scene(const Options& options, const std::string& name, double max_error,
                          HierarchyScene* scene);

}  // namespace ist::benchmark
