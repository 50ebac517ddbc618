#include <cmath>

#include "hard_cases/scene.h"
#include "internal/geometry/tessellation.h"

namespace ist::benchmark {
namespace {

// Dimensions [m]. A mesh has as many triangles as a scanned or exported part has: 10^4 to 2*10^4.
constexpr double kSphereRadius = 0.1;
constexpr double kTubeRadius = 0.05, kTubeLength = 0.3;
constexpr double kDeviation = 4e-5;  // of the cylinder's mesh from the cylinder
constexpr double kEdge = 0.004;      // of the box's squares
const Eigen::Vector3d kBoxSize(0.2, 0.16, 0.1);

// A motion at a robot's usual speeds.
constexpr double kSpeed = 0.25;  // [m/s]
constexpr double kTurn = 1.0;    // [rad/s]
constexpr double kPath = 0.1;    // [m] amplitude of straight motions

RobotDescription body(const std::string& name, const Shape& shape) {
  RobotDescription robot;
  robot.name = name;
  LinkDescription link;
  link.name = name;
  link.geometry = {GeometryElement{shape, Eigen::Isometry3d::Identity(), name}};
  robot.links.push_back(std::move(link));
  return robot;
}

// To and fro along `direction` (unit) about `middle`.
Eigen::Isometry3d slid(const Eigen::Vector3d& middle, const Eigen::Vector3d& direction,
                       double time) {
  Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
  X.translation() = middle + kPath * std::sin(kSpeed / kPath * time) * direction;
  return X;
}

struct Variant {
  std::string name;
  Shape shape;
};

std::vector<Variant> spheres() {
  return {{"sphere", Sphere{kSphereRadius}},
          {"sphere mesh", tessellate(Sphere{kSphereRadius}, 2e-5).mesh}};
}

std::vector<Variant> boxes() {
  return {{"box", Box{kBoxSize}}, {"box mesh", divided_box(kBoxSize, kEdge)}};
}

std::vector<Variant> cylinders() {
  const Cylinder cylinder{kTubeRadius, kTubeLength};
  return {{"cylinder", cylinder}, {"cylinder mesh", tessellate(cylinder, kDeviation).mesh}};
}

void add(const std::string& name, const std::vector<Variant>& variants,
         const std::vector<Patch>& surfaces, const std::function<Eigen::Isometry3d(double)>& pose,
         std::vector<HardScene>* scenes) {
  for (const Variant& variant : variants) {
    scenes->push_back({name, variant.name, body(variant.name, variant.shape), images_of(surfaces),
                       [pose](double time) { return Poses{pose(time)}; }});
  }
}

// A horizontal square of points about the origin at height z.
Patch floor_patch(double side, double z) {
  return plane_patch({-0.5 * side, -0.5 * side, z}, {side, 0, 0}, {0, side, 0});
}

// Slides along x with the body's lowest point `gap` above z = 0.
std::function<Eigen::Isometry3d(double)> sliding(double gap) {
  return [gap](double time) {
    return slid({0, 0, gap + 0.5 * kBoxSize.z()}, Eigen::Vector3d::UnitX(), time);
  };
}

}  // namespace

std::vector<HardScene> body_scenes() {
  std::vector<HardScene> scenes;
  add(
      "duct", cylinders(), {tube_patch(2.0 * kTubeRadius, 4.0 * kTubeLength)},
      [](double time) {
        return Eigen::Isometry3d(slid(Eigen::Vector3d::Zero(), Eigen::Vector3d::UnitZ(), time) *
                                 Eigen::AngleAxisd(kTurn * time, Eigen::Vector3d::UnitZ()));
      },
      &scenes);
  add(
      "concentric shell", spheres(), {sphere_patch(2.0 * kSphereRadius)},
      [](double time) {
        return Eigen::Isometry3d(
            Eigen::AngleAxisd(kTurn * time, Eigen::Vector3d(1, 2, 3).normalized()));
      },
      &scenes);
  add("0.1 mm above a plane", boxes(), {floor_patch(0.6, 0.0)}, sliding(1e-4), &scenes);
  add("parallel to a plane", boxes(), {floor_patch(0.6, 0.0)}, sliding(0.05), &scenes);
  add("bin", boxes(),
      wall_patches(
          Eigen::AlignedBox3d(Eigen::Vector3d(-0.3, -0.2, 0), Eigen::Vector3d(0.3, 0.2, 0.3)),
          true),
      sliding(0.05), &scenes);
  add(
      "corner", boxes(),
      {plane_patch({0, 0, 0}, {0.5, 0, 0}, {0, 0.5, 0}),
       plane_patch({0, 0, 0}, {0, 0.5, 0}, {0, 0, 0.5}),
       plane_patch({0, 0, 0}, {0, 0, 0.5}, {0.5, 0, 0})},
      [](double time) {
        const Eigen::Vector3d diagonal = Eigen::Vector3d::Ones().normalized();
        const double away = 0.02 + kPath * std::sqrt(3.0) / 3.0;  // 20 mm at the nearest
        return slid(Eigen::Vector3d(0.5 * kBoxSize + away * Eigen::Vector3d::Ones()), diagonal,
                    time);
      },
      &scenes);
  add("duplicates", boxes(), {point_patch({0, 0, 0})}, sliding(0.005), &scenes);
  // The shell is 0.65 m above the plane at its nearest.
  add(
      "thin shell far away", {{"bellows", bellows(0.05, 0.008, 0.3, 20)}}, {floor_patch(2.0, 0.0)},
      [](double time) {
        return slid({0, 0, 0.65 + 0.15}, Eigen::Vector3d::UnitX(), time);
      },
      &scenes);
  return scenes;
}

}  // namespace ist::benchmark
