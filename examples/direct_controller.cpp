// A controller that links the library directly, without ROS: from a sensor's points to joint
// velocities, in one loop. The sensor is simulated (a ball that flies through the arm), and so is
// the arm (its joints follow their commands exactly); the rest is as in a real controller.
//
// Usage: direct_controller demo_arm.urdf       (meshes are found by ROS_PACKAGE_PATH)

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <fstream>
#include <limits>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "dodge_controller.h"
#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/contact/contact_model.h"
#include "ist_proximity/contact/contact_wrench.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/repulsion/repulsion.h"
#include "ist_proximity/robot/posed_solids.h"
#include "ist_proximity/robot/robot_model.h"

namespace {

constexpr double kControlPeriod = 0.002;  // [s]
constexpr int kCyclesPerCloud = 16;
constexpr double kDuration = 8.0;  // [s]
constexpr double kBallRadius = 0.08;

/// The points of a ball as a sensor delivers them: float32 x, y, z, in the sensor's frame.
std::vector<float> ball_points(const Eigen::Vector3d& center) {
  constexpr int kCount = 400;
  std::vector<float> points;
  for (int i = 0; i < kCount; ++i) {
    // A Fibonacci lattice spreads points evenly.
    const double z = 1.0 - (2.0 * i + 1.0) / kCount, r = std::sqrt(1.0 - z * z);
    const double angle = i * M_PI * (3.0 - std::sqrt(5.0));
    const Eigen::Vector3d n(r * std::cos(angle), r * std::sin(angle), z);
    const Eigen::Vector3d p = center + kBallRadius * n;
    for (int k = 0; k < 3; ++k) points.push_back(static_cast<float>(p[k]));
  }
  return points;
}

ist::RawCloud as_cloud(const std::vector<float>& xyz) {
  ist::RawCloud cloud;
  cloud.data = reinterpret_cast<const std::uint8_t*>(xyz.data());
  cloud.width = xyz.size() / 3;
  cloud.height = 1;
  cloud.point_step = 3 * sizeof(float);
  cloud.row_step = cloud.width * cloud.point_step;
  cloud.x = 0;
  cloud.y = sizeof(float);
  cloud.z = 2 * sizeof(float);
  return cloud;
}

/// Poses of the model's links, from the joints' positions.
std::vector<Eigen::Isometry3d> link_poses(const ist::Kinematics& kinematics,
                                          const ist::RobotModel& model,
                                          const std::vector<double>& q) {
  ist::JointPoses joints;
  std::vector<Eigen::Isometry3d> X_FL, poses;
  std::vector<bool> known;
  kinematics.place_joints(q, &joints);
  kinematics.place_links(joints, Eigen::Isometry3d::Identity(), &X_FL, &known);
  for (const ist::LinkModel& link : model.links) {
    poses.push_back(X_FL[*kinematics.find_link(link.name)]);
  }
  return poses;
}

/// The links' volumes for contact forces, packed once. 100 spheres are quick to pack, and coarse.
std::vector<std::shared_ptr<const ist::ContactBody>> link_volumes(
    const ist::RobotDescription& robot, const ist::RobotModel& model) {
  ist::ContactConfig config;
  config.packing.max_spheres = 100;
  std::vector<std::shared_ptr<const ist::ContactBody>> bodies;
  for (const ist::LinkModel& link : model.links) {
    const auto same = [&link](const ist::LinkDescription& one) { return one.name == link.name; };
    const auto found = std::find_if(robot.links.begin(), robot.links.end(), same);
    bodies.push_back(ist::build_contact_body(found->geometry, 0, link, config, ""));
  }
  return bodies;
}

/// The contact force [N] on a link: 0 out of contact, NaN where it is not known.
double contact_force(const ist::LinkModel& link, const ist::ContactBody& body,
                     const ist::LinkProximity& answer, const Eigen::Isometry3d& X_FL,
                     const ist::CloudSnapshot& cloud) {
  ist::ContactVolume volume;
  const bool is_known = answer.state == ist::LinkState::kContact && body.has_volume();
  if (is_known) volume = ist::contact_volume(link, body, X_FL, {&cloud});
  return ist::penetration_wrench(answer, {}, is_known ? &volume : nullptr, X_FL, {}).force.norm();
}

int run(const std::string& urdf_path) {
  std::ifstream file(urdf_path);
  std::stringstream urdf;
  urdf << file.rdbuf();

  // The robot is packed once (with RobotModelConfig::cache_directory the next start is quick).
  const ist::RobotDescription robot = ist::parse_urdf(urdf.str(), ist::GeometrySource::kCollision,
                                                      ist::environment_package_finder());
  const auto model = ist::build_robot_model(robot, {});
  const ist::example::ControlledArm arm(robot, {"shoulder_yaw", "shoulder_pitch", "elbow_pitch",
                                                "forearm_roll", "wrist_pitch", "wrist_roll"});
  const ist::example::DodgeConfig controller;

  const auto volumes = link_volumes(robot, *model);

  ist::RepulsionConfig repulsion_config;
  repulsion_config.influence_distance = 0.5;
  ist::Ingest ingest{ist::IngestConfig()};
  ist::ProximityQuery query(model, {});
  const ist::Repulsion repulsion(model);
  ist::CloudSnapshot snapshot;
  std::vector<ist::LinkProximity> answers;
  const std::vector<bool> known(model->links.size(), true);

  std::vector<double> q(arm.kinematics.joints().size(), 0.0);
  Eigen::VectorXd goal(6);
  goal << 0.0, 0.6, 0.9, 0.0, 0.3, 0.0;
  for (std::size_t j = 0; j < arm.joints.size(); ++j) {
    q[arm.joints[j]] = goal[static_cast<Eigen::Index>(j)];
  }

  double smallest = std::numeric_limits<double>::infinity(), largest_force = 0.0;
  for (int cycle = 0; cycle * kControlPeriod < kDuration; ++cycle) {
    const double now = cycle * kControlPeriod;
    const std::vector<Eigen::Isometry3d> X_FL = link_poses(arm.kinematics, *model, q);

    // A new cloud loses its points on the robot, whose poses are those at the cloud's stamp.
    if (cycle % kCyclesPerCloud == 0) {
      const std::vector<float> points = ball_points({0.55, -1.0 + 0.25 * now, 0.30});
      const Eigen::Isometry3d X_FS = Eigen::Isometry3d::Identity();
      ingest.run(as_cloud(points), X_FS, ist::posed_solids(*model, X_FL, known), now, &snapshot);
    }

    // The query may run in a controller's own thread: it allocates nothing and never throws.
    query.run(X_FL, known, {&snapshot}, &answers);

    ist::example::Reading reading;
    reading.is_ok = true;
    reading.cloud_age = now - snapshot.stamp;
    for (std::size_t i = 0; i < answers.size(); ++i) {
      const Eigen::Vector3d away = repulsion(i, X_FL[i], {&snapshot}, answers[i], repulsion_config);
      const std::size_t link = *arm.kinematics.find_link(model->links[i].name);
      reading.links.push_back({link, answers[i].lower_bound, answers[i].p_LCl, away});
      smallest = std::min(smallest, answers[i].lower_bound);
      largest_force = std::max(largest_force, contact_force(model->links[i], *volumes[i],
                                                            answers[i], X_FL[i], snapshot));
    }
    const Eigen::VectorXd dq = dodge(arm, q, goal, reading, controller);
    for (std::size_t j = 0; j < arm.joints.size(); ++j) {
      q[arm.joints[j]] += kControlPeriod * dq[static_cast<Eigen::Index>(j)];
    }
  }
  const bool is_back = has_reached(arm, q, goal, controller);
  std::printf(
      "smallest lower bound: %.3f m; largest contact force: %.1f N; back at its place: %s\n",
      smallest, largest_force, is_back ? "yes" : "no");
  return smallest > 0.0 && smallest < controller.keep_distance && is_back ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "Usage: direct_controller demo_arm.urdf\n");
    return 2;
  }
  try {
    return run(argv[1]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
