#include <algorithm>
#include <cmath>
#include <memory>

#include "hard_cases/demo_motion.h"
#include "hard_cases/scene.h"

namespace ist::benchmark {
namespace {

constexpr double kClearance = 0.05;   // [m] from the arm's motion to the walls of the enclosure
constexpr double kDepth = 5e-4;       // [m] to which the resting arm is pressed into the table
constexpr double kSwing = 0.2;        // [rad] amplitude of each joint
constexpr double kJointSpeed = 0.75;  // [rad/s] largest speed of each joint
constexpr double kDuration = 2.0 * EIGEN_PI * kSwing / kJointSpeed;  // [s] until it repeats

double swing(double time) { return kSwing * std::sin(kJointSpeed / kSwing * time); }

HardScene machine_tool(const std::shared_ptr<const DemoMotion>& arm) {
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
HardScene table(const std::shared_ptr<const DemoMotion>& arm) {
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
  const auto arm = std::make_shared<const DemoMotion>();
  return {machine_tool(arm), table(arm)};
}

}  // namespace ist::benchmark
