#pragma once

#include <algorithm>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "ist_proximity/proximity/self_query.h"
#include "ist_proximity/robot/link_poses.h"
#include "support/data_dir.h"
#include "support/link_pair_oracle.h"
#include "support/scene.h"
#include "support/truth.h"

namespace ist::benchmark {

using ist::LinkPair;

/// A robot whose links are measured against one another.
struct Robot {
  std::string name;
  ist::RobotDescription description;
  std::shared_ptr<const ist::RobotModel> model;
  std::shared_ptr<const ist::Kinematics> kinematics;
  std::vector<LinkPair> pairs;
  std::vector<std::vector<ist::test::Corners3<double>>> triangles;  // by link
  // [m] By link: the triangles of its cylinders and spheres are at most this far inside them.
  std::vector<double> inexactness;
  bool is_meshes = true;  // no cylinders and spheres, which FCL would measure as triangles

  std::vector<double> random_position(ist::test::Rng* rng) const {
    std::vector<double> q;
    for (const auto& joint : kinematics->joints()) {
      const double low = std::max(joint.lower, -3.1), high = std::min(joint.upper, 3.1);
      q.push_back(joint.is_free() ? ist::test::uniform(rng, low, high) : 0.0);
    }
    return q;
  }
};

inline Robot make_robot(std::string name, ist::RobotDescription description) {
  Robot robot;
  robot.name = std::move(name);
  robot.description = std::move(description);
  ist::RobotModelConfig config;
  config.packing.max_error = 0.01;
  robot.model = ist::build_robot_model(robot.description, config);
  robot.kinematics = std::make_shared<const ist::Kinematics>(robot.description);
  const std::vector<bool> all(robot.model->links.size(), true);
  robot.pairs = ist::self_collision_pairs(*robot.model, *robot.kinematics, all, {});
  for (const ist::LinkModel& link : robot.model->links) {
    for (const ist::LinkDescription& described : robot.description.links) {
      if (described.name != link.name) continue;
      robot.triangles.push_back(ist::test::triangles_of(described.geometry));
      robot.inexactness.push_back(
          ist::test::append_round_shapes(described.geometry, &robot.triangles.back()));
      for (const ist::GeometryElement& element : described.geometry) {
        robot.is_meshes = robot.is_meshes &&
                          !std::holds_alternative<ist::Cylinder>(element.shape) &&
                          !std::holds_alternative<ist::Sphere>(element.shape);
      }
    }
  }
  return robot;
}

inline Robot panda(const std::filesystem::path& data, ist::GeometrySource source,
                   std::string name) {
  return make_robot(std::move(name), ist::test::read_panda(data, source));
}

}  // namespace ist::benchmark
