#include "hard_cases/scene.h"

#include <cmath>
#include <memory>
#include <set>
#include <utility>

#include "hard_cases/near.h"
#include "hard_cases/surface.h"
#include "internal/geometry/tessellation.h"
#include "ist_proximity/robot/link_poses.h"
#include "support/demo_arm.h"
#include "support/robot_of_links.h"

namespace ist::benchmark {
namespace {

using Eigen::Vector3d;
using PoseAt = std::function<Eigen::Isometry3d(double)>;

// Dimensions [m]. A mesh has as many triangles as a scanned or exported part has: 10^4 to 2*10^4.
constexpr double kSphereRadius = 0.1;
constexpr double kTubeRadius = 0.05, kTubeLength = 0.3;
constexpr double kDeviation = 4e-5;  // of the cylinder's mesh from the cylinder
constexpr double kEdge = 0.004;      // of the box's squares
const Vector3d kBoxSize(0.2, 0.16, 0.1);

// A motion at a robot's usual speeds.
constexpr double kSpeed = 0.25;  // [m/s]
constexpr double kTurn = 1.0;    // [rad/s]
constexpr double kPath = 0.1;    // [m] amplitude of straight motions

constexpr double kClearance = 0.05;   // [m] from the arm's motion to the walls of the enclosure
constexpr double kDepth = 5e-4;       // [m] to which the resting arm is pressed into the table
constexpr double kSwing = 0.2;        // [rad] amplitude of each joint
constexpr double kJointSpeed = 0.75;  // [rad/s] largest speed of each joint
constexpr double kDuration = 2.0 * EIGEN_PI * kSwing / kJointSpeed;  // [s] until it repeats

// Unorganized clouds, sampled anew from the surfaces. The sensor frame is the fixed frame.
std::function<Frame(std::size_t, double, std::mt19937_64*)> images_of(
    const std::vector<Patch>& surfaces) {
  return [surfaces](std::size_t points, double noise, std::mt19937_64* rng) {
    Frame frame;
    frame.width = points;
    frame.height = 1;
    frame.data.reserve(4 * points);
    for (const Vector3d& p : sample(surfaces, points, noise, rng)) {
      const Eigen::Vector3f q = p.cast<float>();
      frame.data.insert(frame.data.end(), {q.x(), q.y(), q.z(), 0.0F});
    }
    return frame;
  };
}

HardScene body_scene(const std::string& name, const std::string& link, const TriangleMesh& mesh,
                     const std::vector<Patch>& surfaces, const PoseAt& pose) {
  const GeometryElement element{mesh, Eigen::Isometry3d::Identity(), link};
  return {name, link, test::robot_of({{element}}), images_of(surfaces),
          [pose](double time) { return Poses{pose(time)}; }};
}

// To and fro along `direction` (unit) about `middle`.
Eigen::Isometry3d slid(const Vector3d& middle, const Vector3d& direction, double time) {
  return Eigen::Isometry3d(
      Eigen::Translation3d(middle + kPath * std::sin(kSpeed / kPath * time) * direction));
}

// A horizontal square of points about the origin.
Patch floor_patch(double side) {
  return plane_patch({-0.5 * side, -0.5 * side, 0}, {side, 0, 0}, {0, side, 0});
}

// Slides along x with the box's lowest point `gap` above z = 0.
PoseAt sliding(double gap) {
  return [gap](double time) {
    return slid({0, 0, gap + 0.5 * kBoxSize.z()}, Vector3d::UnitX(), time);
  };
}

std::vector<HardScene> round_scenes() {
  const TriangleMesh cylinder = tessellate(Cylinder{kTubeRadius, kTubeLength}, kDeviation).mesh;
  const TriangleMesh sphere = tessellate(Sphere{kSphereRadius}, 2e-5).mesh;
  const auto in_duct = [](double time) {
    return Eigen::Isometry3d(slid(Vector3d::Zero(), Vector3d::UnitZ(), time) *
                             Eigen::AngleAxisd(kTurn * time, Vector3d::UnitZ()));
  };
  const auto turning = [](double time) {
    return Eigen::Isometry3d(Eigen::AngleAxisd(kTurn * time, Vector3d(1, 2, 3).normalized()));
  };
  return {body_scene("duct", "cylinder mesh", cylinder,
                     {tube_patch(2.0 * kTubeRadius, 4.0 * kTubeLength)}, in_duct),
          body_scene("concentric shell", "sphere mesh", sphere, {sphere_patch(2.0 * kSphereRadius)},
                     turning)};
}

std::vector<HardScene> box_scenes() {
  const TriangleMesh mesh = divided_box(kBoxSize, kEdge);
  std::vector<HardScene> scenes;
  const auto add = [&](const std::string& name, const std::vector<Patch>& surfaces,
                       const PoseAt& pose) {
    scenes.push_back(body_scene(name, "box mesh", mesh, surfaces, pose));
  };
  add("0.1 mm above a plane", {floor_patch(0.6)}, sliding(1e-4));
  add("parallel to a plane", {floor_patch(0.6)}, sliding(0.05));
  add("bin", wall_patches({Vector3d(-0.3, -0.2, 0), Vector3d(0.3, 0.2, 0.3)}, true), sliding(0.05));
  add("corner",
      {plane_patch({0, 0, 0}, {0.5, 0, 0}, {0, 0.5, 0}),
       plane_patch({0, 0, 0}, {0, 0.5, 0}, {0, 0, 0.5}),
       plane_patch({0, 0, 0}, {0, 0, 0.5}, {0.5, 0, 0})},
      [](double time) {
        const double away = 0.02 + kPath * std::sqrt(3.0) / 3.0;  // 20 mm at the nearest
        return slid(0.5 * kBoxSize + away * Vector3d::Ones(), Vector3d::Ones().normalized(), time);
      });
  add("duplicates", {point_patch({0, 0, 0})}, sliding(0.005));
  // The shell is 0.65 m above the plane at its nearest.
  scenes.push_back(body_scene("thin shell far away", "bellows", bellows(0.05, 0.008, 0.3, 20),
                              {floor_patch(2.0)}, [](double time) {
                                return slid({0, 0, 0.65 + 0.15}, Vector3d::UnitX(), time);
                              }));
  return scenes;
}

// The extent of the demo arm's links, but for those named.
Eigen::AlignedBox3d extent(const RobotDescription& arm, const Poses& X_FL,
                           const std::set<std::string>& without = {}) {
  Eigen::AlignedBox3d box;
  for (std::size_t i = 0; i < arm.links.size(); ++i) {
    if (without.count(arm.links[i].name) > 0) continue;
    for (const GeometryElement& element : arm.links[i].geometry) {
      for (const Vector3d& v : mesh_of(element.shape, 1e-4).vertices) {
        box.extend(X_FL[i] * element.X_LE * v);
      }
    }
  }
  return box;
}

double swing(double time) { return kSwing * std::sin(kJointSpeed / kSwing * time); }

HardScene machine_tool(const RobotDescription& arm) {
  const auto poses = [](double time) {
    const double s = swing(time), c = swing(time + 0.25 * kDuration);
    return demo_poses({s, 0.5 + c, 1.0 - s, c, 0.4 + s, s});
  };
  Eigen::AlignedBox3d box;
  for (double time = 0.0; time < kDuration; time += 0.05 * kDuration) {
    box.extend(extent(arm, poses(time)));
  }
  box.min().array() -= kClearance;
  box.max().array() += kClearance;
  return {"inside a machine tool", "demo arm", arm, images_of(wall_patches(box, false)), poses};
}

// The arm turns about its base, so that what touches the table keeps its depth and slides.
HardScene table(const RobotDescription& arm) {
  const auto poses = [](double time) { return demo_poses({swing(time), 1.5, 0.9, 0.0, 0.6}); };
  const std::set<std::string> beside = {"base_link", "stand_link", "shoulder_link"};
  const double height = extent(arm, poses(0.0), beside).min().z() + kDepth;
  return {"resting on a table", "demo arm", arm,
          images_of({plane_patch({0.2, -0.6, height}, {0.8, 0, 0}, {0, 1.2, 0})}), poses};
}

}  // namespace

Poses demo_poses(const std::vector<double>& q) {
  static const Kinematics kinematics(test::demo_robot());
  std::vector<double> positions(kinematics.joints().size(), 0.0);
  std::size_t next = 0;
  for (std::size_t j = 0; j < positions.size() && next < q.size(); ++j) {
    if (kinematics.joints()[j].is_free()) positions[j] = q[next++];
  }
  return link_poses(*test::demo_model(), kinematics, positions).X_FL;
}

std::vector<HardScene> hard_scenes() {
  std::vector<HardScene> scenes = round_scenes();
  for (const HardScene& scene : box_scenes()) scenes.push_back(scene);
  const RobotDescription arm = test::demo_robot();
  scenes.push_back(machine_tool(arm));
  scenes.push_back(table(arm));
  return scenes;
}

std::function<Frame(std::size_t, double, std::mt19937_64*)> images_after(const Frame& frame) {
  return [frame, is_first = true](std::size_t, double, std::mt19937_64* rng) mutable {
    return std::exchange(is_first, false) ? frame : next_image(frame, kKinectNoise, rng);
  };
}

std::vector<HardScene> recorded_scenes(const std::filesystem::path& data,
                                       const std::string& cache_directory) {
  constexpr std::size_t kParts = 20;
  const MovingRobot robot = moving_robots(data).front();
  // Parts of the motion, one after the other; the first query of each is as good as cold.
  const auto motion = std::make_shared<std::vector<Poses>>();
  for (std::size_t part = 0; part < kParts; ++part) {
    for (const Poses& X_FL : robot.part(part)) motion->push_back(X_FL);
  }
  const auto poses = [motion](double time) {
    return (*motion)[static_cast<std::size_t>(std::lround(1e3 * time)) % motion->size()];
  };
  std::vector<HardScene> scenes;
  for (const Scene& recorded : kinect_data(data, cache_directory).scenes) {
    scenes.push_back({"Kinect frame " + recorded.name, robot.name, robot.robot,
                      images_after(recorded.frame), poses, true});
  }
  return scenes;
}

}  // namespace ist::benchmark
