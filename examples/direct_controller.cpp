// A controller that links the library directly, without ROS: from a sensor's points to joint
// velocities, in one loop. The sensor is simulated (a sphere that flies through the arm), and so is
// the arm (its joints follow every command); the rest is what a real controller would do.
//
// Usage: direct_controller demo_arm.urdf       (meshes are found by ROS_PACKAGE_PATH)

#include <algorithm>
#include <cmath>
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
#include "ist_proximity/contact/contact_volume.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/proximity/speed_scale.h"
#include "ist_proximity/repulsion/repulsion.h"
#include "ist_proximity/robot/link_poses.h"
#include "ist_proximity/robot/robot_model.h"

namespace {

constexpr double kControlPeriod = 0.002;  // [s]
constexpr int kCyclesPerCloud = 16;
constexpr double kDuration = 8.0;  // [s]
constexpr double kSphereRadius = 0.08;

/// A sensor's data: points of a sphere, float32 x, y, z, in the sensor's frame.
std::vector<float> sphere_points(const Eigen::Vector3d& center) {
  constexpr int kCount = 400;
  std::vector<float> points;
  for (int i = 0; i < kCount; ++i) {
    // A Fibonacci lattice: evenly spread.
    const double z = 1.0 - (2.0 * i + 1.0) / kCount, r = std::sqrt(1.0 - z * z);
    const double angle = i * M_PI * (3.0 - std::sqrt(5.0));
    const Eigen::Vector3d n(r * std::cos(angle), r * std::sin(angle), z);
    const Eigen::Vector3d p = center + kSphereRadius * n;
    for (int k = 0; k < 3; ++k) points.push_back(static_cast<float>(p[k]));
  }
  return points;
}

ist::RawCloud as_cloud(const std::vector<float>& xyz) {
  return ist::packed_cloud(xyz.data(), xyz.size() / 3, 1);
}

/// The links' volumes, for forces in contact; built once. 100 spheres are quick to pack, and
/// coarse.
std::vector<std::shared_ptr<const ist::ContactGeometry>> link_volumes(
    const ist::RobotDescription& robot, const ist::RobotModel& model) {
  ist::ContactConfig config;
  config.packing.max_spheres = 100;
  std::vector<std::shared_ptr<const ist::ContactGeometry>> volumes;
  for (const ist::LinkModel& link : model.links) {
    const auto same = [&link](const ist::LinkDescription& one) { return one.name == link.name; };
    const auto found = std::find_if(robot.links.begin(), robot.links.end(), same);
    volumes.push_back(ist::build_contact_geometry(found->geometry, 0, link, config, ""));
  }
  return volumes;
}

/// The scale of the task's speed: links that cannot move do not count.
class TaskSpeed {
 public:
  TaskSpeed(const ist::RobotModel& model, const ist::Kinematics& kinematics)
      : scale_(names(model)), moves_(ist::links_that_move(model, kinematics, model.root_link)) {}

  double update(const std::vector<ist::LinkProximity>& answers) {
    inputs_.clear();
    for (const ist::LinkProximity& answer : answers) {
      inputs_.push_back({answer.state, answer.lower_bound});
    }
    return scale_.update({}, inputs_, moves_, 0.0).scale;
  }

 private:
  static std::vector<std::string> names(const ist::RobotModel& model) {
    std::vector<std::string> names;
    for (const ist::LinkModel& link : model.links) names.push_back(link.name);
    return names;
  }

  ist::SpeedScale scale_;
  std::vector<bool> moves_;  // by link
  std::vector<ist::SpeedScaleInput> inputs_;
};

/// [N] The contact force on a link: 0 out of contact, NaN where it is not known.
double contact_force(const ist::LinkModel& link, const ist::ContactGeometry& geometry,
                     const ist::LinkProximity& answer, const Eigen::Isometry3d& X_FL,
                     const ist::CloudSnapshot& cloud) {
  ist::ContactVolume volume;
  const bool is_known = answer.state == ist::LinkState::kContact && geometry.has_volume();
  if (is_known) volume = ist::contact_volume(link, geometry, X_FL, {&cloud});
  return ist::penetration_wrench(answer, {}, is_known ? &volume : nullptr, X_FL, {}).force.norm();
}

int run(const std::string& urdf_path) {
  std::ifstream file(urdf_path);
  std::stringstream urdf;
  urdf << file.rdbuf();

  // Once: the robot, packed (RobotModelConfig::cache_directory makes the next start quick).
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
  TaskSpeed task_speed(*model, arm.kinematics);
  ist::ForwardKinematics forward(*model, std::make_shared<const ist::Kinematics>(robot));

  std::vector<double> q(arm.kinematics.joints().size(), 0.0);
  Eigen::VectorXd goal(6);
  goal << 0.0, 0.6, 0.9, 0.0, 0.3, 0.0;
  for (std::size_t j = 0; j < arm.joints.size(); ++j) {
    q[arm.joints[j]] = goal[static_cast<Eigen::Index>(j)];
  }

  double smallest = std::numeric_limits<double>::infinity(), largest_force = 0.0;
  for (int cycle = 0; cycle * kControlPeriod < kDuration; ++cycle) {
    const double now = cycle * kControlPeriod;
    const auto& [X_FL, known] = forward.run(q);

    // A new cloud: what lies on the robot, where it was at the cloud's stamp, is dropped.
    if (cycle % kCyclesPerCloud == 0) {
      const std::vector<float> points = sphere_points({0.55, -1.0 + 0.25 * now, 0.30});
      const Eigen::Isometry3d X_FS = Eigen::Isometry3d::Identity();
      ingest.run(as_cloud(points), X_FS, ist::posed_solids(*model, X_FL, known), now, &snapshot);
    }

    // In a controller's own thread: allocates nothing, never throws.
    query.run(X_FL, known, {&snapshot}, &answers);

    ist::example::Reading reading;
    reading.is_ok = true;
    reading.cloud_age = now - snapshot.stamp;
    reading.speed_scale = task_speed.update(answers);
    for (std::size_t i = 0; i < answers.size(); ++i) {
      const Eigen::Vector3d away = repulsion(i, X_FL[i], {&snapshot}, answers[i], repulsion_config);
      reading.links.push_back({*forward.body(i), answers[i].lower_bound, answers[i].p_LCl, away});
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
