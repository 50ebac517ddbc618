#include <algorithm>
#include <cmath>
#include <memory>

#include "hard_cases/scene.h"
#include "ist_proximity/robot/kinematics.h"
#include "support/demo_arm.h"

namespace ist::benchmark {
namespace {

constexpr double kClearance = 0.05;   // [m] from the arm's motion to the walls of the enclosure
constexpr double kDepth = 5e-4;       // [m] to which the resting arm is pressed into the table
constexpr double kSwing = 0.2;        // [rad] amplitude of each joint
constexpr double kJointSpeed = 0.75;  // [rad/s] largest speed of each joint
constexpr double kDuration = 2.0 * EIGEN_PI * kSwing / kJointSpeed;  // [s] until it repeats

// The demo arm with its kinematics.
class Arm {
 public:
  Arm() : robot_(test::demo_robot()), kinematics_(robot_) {
    for (const LinkDescription& link : robot_.links) {
      bodies_.push_back(kinematics_.find_body(link.name).value());
    }
  }

  const RobotDescription& robot() const { return robot_; }

  // X_FL by link; the root link's frame is the fixed frame.
  // @param q  [rad] by free joint in the order of the URDF; joints that q lacks are at zero
  Poses poses(const std::vector<double>& q) const {
    std::vector<double> positions(kinematics_.joints().size(), 0.0);
    std::size_t next = 0;
    for (std::size_t j = 0; j < positions.size() && next < q.size(); ++j) {
      if (kinematics_.joints()[j].is_free()) positions[j] = q[next++];
    }
    JointPoses joints;
    kinematics_.place_joints(positions, &joints);
    BodyPoses all;
    kinematics_.place_bodies(joints, Eigen::Isometry3d::Identity(), &all);
    Poses X_FL;
    for (const std::size_t body : bodies_) X_FL.push_back(all.X_FB[body]);
    return X_FL;
  }

  // The extent of the links for which `is_wanted` is true.
  Eigen::AlignedBox3d extent(const Poses& X_FL,
                             const std::function<bool(const std::string&)>& is_wanted) const {
    Eigen::AlignedBox3d box;
    for (std::size_t i = 0; i < robot_.links.size(); ++i) {
      if (!is_wanted(robot_.links[i].name)) continue;
      for (const GeometryElement& element : robot_.links[i].geometry) {
        for (const Eigen::Vector3d& v : vertices_of(element.shape)) {
          box.extend(X_FL[i] * element.X_LE * v);
        }
      }
    }
    return box;
  }

 private:
  RobotDescription robot_;
  Kinematics kinematics_;
  std::vector<std::size_t> bodies_;  // by link: its body
};

double swing(double time) { return kSwing * std::sin(kJointSpeed / kSwing * time); }

HardScene machine_tool(const std::shared_ptr<const Arm>& arm) {
  const auto poses = [arm](double time) {
    const double s = swing(time), c = swing(time + 0.25 * kDuration);
    return arm->poses({s, 0.5 + c, 1.0 - s, c, 0.4 + s, s});
  };
  Eigen::AlignedBox3d box;
  for (double time = 0.0; time < kDuration; time += 0.05 * kDuration) {
    box.extend(arm->extent(poses(time), [](const std::string& /*link*/) { return true; }));
  }
  const Eigen::Vector3d more = Eigen::Vector3d::Constant(kClearance);
  return {"inside a machine tool", "demo arm", arm->robot(),
          images_of(wall_patches(Eigen::AlignedBox3d(Eigen::Vector3d(box.min() - more),
                                                     Eigen::Vector3d(box.max() + more)),
                                 false)),
          poses};
}

// The arm turns about its base, so that what touches the table keeps its depth and slides.
HardScene table(const std::shared_ptr<const Arm>& arm) {
  const auto poses = [arm](double time) { return arm->poses({swing(time), 1.5, 0.9, 0.0, 0.6}); };
  const Eigen::AlignedBox3d box = arm->extent(poses(0.0), [](const std::string& link) {
    return link != "base_link" && link != "stand_link" && link != "shoulder_link";
  });
  const double height = box.min().z() + kDepth;
  return {"resting on a table", "demo arm", arm->robot(),
          images_of({plane_patch({0.2, -0.6, height}, {0.8, 0, 0}, {0, 1.2, 0})}), poses};
}

}  // namespace

std::vector<HardScene> arm_scenes() {
  const auto arm = std::make_shared<const Arm>();
  return {machine_tool(arm), table(arm)};
}

}  // namespace ist::benchmark
