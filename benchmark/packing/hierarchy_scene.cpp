#include "packing/hierarchy_scene.h"

#include <algorithm>
#include <memory>
#include <random>
#include <utility>

#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/robot/link_poses.h"
#include "peers/scene.h"
#include "support/demo_arm.h"
#include "support/whole_cloud.h"

namespace ist::benchmark {
namespace {

using Poses = std::vector<Eigen::Isometry3d>;

// The snapshot keeps the frame: queries read its points when they need them.
CloudSnapshot ingested(Frame frame) {
  const auto owner = std::make_shared<const Frame>(std::move(frame));
  RawCloud raw = owner->raw();
  raw.owner = owner;
  CloudSnapshot snapshot;
  Ingest(test::whole_cloud(false)).run(raw, owner->X_FS, {}, 0.0, &snapshot);
  return snapshot;
}

// Link poses from random joint positions within their limits.
std::vector<Poses> demo_poses(const RobotDescription& robot, const RobotModel& model, bool motion) {
  const Kinematics kinematics(robot);
  const Eigen::Isometry3d X_FR(Eigen::Translation3d(-0.8, 0.0, -0.2));  // next to the table
  std::mt19937_64 rng(1);
  const auto draw = [&] {
    std::vector<double> q;
    for (const Kinematics::Joint& joint : kinematics.joints()) {
      const double low = std::max(joint.lower, -M_PI), high = std::min(joint.upper, M_PI);
      q.push_back(low < high ? std::uniform_real_distribution<double>(low, high)(rng) : 0.0);
    }
    return q;
  };
  const auto place = [&](const std::vector<double>& q) {
    return link_poses(model, kinematics, q, X_FR).X_FL;
  };
  std::vector<Poses> poses;
  while (!motion && poses.size() < kHierarchySteps / 4) poses.push_back(place(draw()));
  constexpr std::size_t kDuration = 500;  // [ms] from one position to the next
  for (std::vector<double> from = draw(); poses.size() < kHierarchySteps && motion;) {
    const std::vector<double> to = draw();
    for (std::size_t step = 0; step < kDuration; ++step) {
      std::vector<double> q = from;
      const double share = static_cast<double>(step) / static_cast<double>(kDuration);
      for (std::size_t j = 0; j < q.size(); ++j) q[j] += share * (to[j] - q[j]);
      poses.push_back(place(q));
    }
    from = to;
  }
  return poses;
}

// Links in contact are answered by the depth query, which does not depend on the tree. They are
// left out.
void find_free(HierarchyScene* scene) {
  ProximityQuery query(scene->model, hierarchy_query_config());
  std::vector<LinkProximity> results;
  const std::vector<bool> all(scene->model->links.size(), true);
  for (const CloudSnapshot& cloud : scene->clouds) {
    scene->known.emplace_back();
    for (const Poses& X_FL : scene->poses) {
      query.run(X_FL, all, {&cloud}, &results);
      std::vector<bool> known;
      for (const LinkProximity& link : results) known.push_back(link.state == LinkState::kNear);
      scene->known.back().push_back(known);
    }
  }
}

// Poses of the synthetic links, a motion or one by one.
std::vector<Poses> synthetic_poses(std::size_t links, bool motion) {
  std::mt19937_64 rng(1);
  std::vector<Poses> poses(motion ? 4 : kHierarchySteps / 4);
  for (Poses& X_FL : poses) {
    for (std::size_t i = 0; i < links; ++i) X_FL.push_back(synthetic_pose(&rng));
  }
  return motion ? interpolated(poses, 400) : poses;
}

}  // namespace

QueryConfig hierarchy_query_config() {
  QueryConfig config;
  config.max_distance = 10.0;
  return config;
}

bool make_hierarchy_scene(const Options& options, const std::string& name, double max_error,
                          HierarchyScene* scene) {
  const bool motion = name.find("motion") != std::string::npos;
  if (name.rfind("Panda", 0) == 0) {
    if (options.data.empty()) return false;
    const DataSet set = kinect_data(options.data, options.cache_directory);
    scene->model = set.robot.pack(max_error);
    for (const Scene& one : set.scenes) {
      scene->clouds.push_back(ingested(one.frame));
      if (motion || !scene->poses.empty()) continue;  // the poses are the same in all of them
      for (const Configuration& c : one.configurations) scene->poses.push_back(c.X_FL);
    }
    if (motion) scene->poses = set.motion;
  } else if (name.rfind("demo", 0) == 0) {
    const RobotDescription robot = test::demo_robot();
    RobotModelConfig config;
    config.packing.max_error = max_error;
    config.cache_directory = options.cache_directory;
    scene->model = build_robot_model(robot, config);
    scene->clouds.push_back(ingested(synthetic_frame(640, 480)));
    scene->poses = demo_poses(robot, *scene->model, motion);
  } else {
    Robot robot;
    robot.cache_directory = options.cache_directory;
    robot.meshes = synthetic_meshes();
    scene->model = robot.pack(max_error);
    scene->clouds.push_back(ingested(synthetic_frame(640, 480)));
    scene->poses = synthetic_poses(robot.meshes.size(), motion);
  }
  if (motion) scene->poses.resize(std::min(scene->poses.size(), kHierarchySteps));
  find_free(scene);
  return true;
}

}  // namespace ist::benchmark
