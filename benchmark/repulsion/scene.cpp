#include "repulsion/scene.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <limits>
#include <random>

#include "internal/geometry/mesh_io.h"
#include "internal/geometry/tessellation.h"
#include "ist_proximity/cloud/ingest.h"
#include "support/npy.h"
#include "support/pcd.h"
#include "support/truth.h"

namespace ist::benchmark {
namespace {

using Points = std::vector<Eigen::Vector3d>;

constexpr double kStep = 0.001;       // [m] that no point of the robot is moved farther in
constexpr double kSpacing = 0.005;    // [m] about, between the points on analytic obstacles
constexpr double kNeighbours = 0.03;  // [m] pixels nearer to each other are on one surface

CloudSnapshot ingested(const Points& points) {
  IngestConfig config;
  config.self_filter = false;
  config.min_range = 0.0;
  config.max_range = 1e3;
  std::vector<float> data;
  for (const Eigen::Vector3d& p : points) {
    for (int i = 0; i < 3; ++i) data.push_back(static_cast<float>(p[i]));
  }
  RawCloud raw;
  raw.data = reinterpret_cast<const std::uint8_t*>(data.data());
  raw.width = points.size();
  raw.height = 1;
  raw.point_step = 12;
  raw.row_step = 12 * points.size();
  raw.y = 4;
  raw.z = 8;
  CloudSnapshot cloud;
  Ingest(config).run(raw, Eigen::Isometry3d::Identity(), {}, 0.0, &cloud);
  return cloud;
}

// Half of the points, all, and twice as many.
void set_clouds(const Points& twice, MovingScene* scene) {
  Points all, half;
  for (std::size_t i = 0; i < twice.size(); ++i) {
    if (i % 2 == 0) all.push_back(twice[i]);
    if (i % 4 == 0) half.push_back(twice[i]);
  }
  scene->cloud = ingested(all);
  scene->half = ingested(half);
  scene->twice = ingested(twice);
}

Eigen::Isometry3d between(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b, double s) {
  Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
  X.linear() =
      Eigen::Quaterniond(a.linear()).slerp(s, Eigen::Quaterniond(b.linear())).toRotationMatrix();
  X.translation() = (1.0 - s) * a.translation() + s * b.translation();
  return X;
}

// Moves through waypoints, in steps of at most kStep for every vertex.
void set_steps(const std::vector<std::vector<Eigen::Isometry3d>>& waypoints, MovingScene* scene) {
  std::vector<Points> corners;
  for (const LinkDescription& link : scene->robot.links) {
    Points points;
    for (const GeometryElement& element : link.geometry) {
      const auto& mesh = std::get<TriangleMesh>(element.shape);
      for (const Eigen::Vector3d& p : mesh.vertices) points.push_back(element.X_LE * p);
    }
    corners.push_back(std::move(points));
  }
  for (std::size_t k = 0; k + 1 < waypoints.size(); ++k) {
    double farthest = 0.0;
    for (std::size_t i = 0; i < corners.size(); ++i) {
      for (std::size_t c = 0; c < corners[i].size(); c += 1 + corners[i].size() / 500) {
        farthest = std::max(
            farthest,
            (waypoints[k][i] * corners[i][c] - waypoints[k + 1][i] * corners[i][c]).norm());
      }
    }
    // A fifth more: along the arc a point moves a little more than along its chord.
    const int count = std::max(1, static_cast<int>(std::ceil(1.2 * farthest / kStep)));
    for (int s = 0; s < count; ++s) {
      std::vector<Eigen::Isometry3d> X_FL;
      for (std::size_t i = 0; i < corners.size(); ++i) {
        X_FL.push_back(
            between(waypoints[k][i], waypoints[k + 1][i], static_cast<double>(s) / count));
      }
      scene->steps.push_back(std::move(X_FL));
      scene->begins.push_back(k == 0 && s == 0);
    }
  }
}

Eigen::Isometry3d pose(const Eigen::Vector3d& p, const Eigen::Vector3d& turn) {
  Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
  X.translation() = p;
  if (!turn.isZero()) X.rotate(Eigen::AngleAxisd(turn.norm(), turn.normalized()));
  return X;
}

// Points of a surface u, v in [0, 1]^2 of the given area, at random, the same for every run.
void add_surface(double area, const std::function<Eigen::Vector3d(double, double)>& surface,
                 std::mt19937_64* rng, Points* twice) {
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  const auto count = static_cast<std::size_t>(2.0 * area / (kSpacing * kSpacing));
  for (std::size_t i = 0; i < count; ++i) {
    const double u = unit(*rng), v = unit(*rng);
    twice->push_back(surface(u, v));
  }
}

void add_plate(const Eigen::Vector3d& center, const Eigen::Vector3d& u, const Eigen::Vector3d& v,
               std::mt19937_64* rng, Points* twice) {
  add_surface(
      u.norm() * v.norm(),
      [&](double s, double t) { return Eigen::Vector3d(center + (s - 0.5) * u + (t - 0.5) * v); },
      rng, twice);
}

RobotDescription one_link(const std::string& name, const TriangleMesh& mesh) {
  RobotDescription robot;
  robot.name = name;
  LinkDescription link;
  link.name = name;
  link.geometry = {GeometryElement{mesh, Eigen::Isometry3d::Identity(), name}};
  robot.links.push_back(link);
  return robot;
}

MovingScene analytic(const std::string& name, const TriangleMesh& mesh, const Points& twice,
                     const std::vector<Eigen::Isometry3d>& waypoints) {
  MovingScene scene;
  scene.name = name;
  scene.robot = one_link(name, mesh);
  set_clouds(twice, &scene);
  std::vector<std::vector<Eigen::Isometry3d>> links;
  for (const Eigen::Isometry3d& X : waypoints) links.push_back({X});
  set_steps(links, &scene);
  scene.reference_count = scene.steps.size();
  return scene;
}

// The first poses of the recorded trajectory, by link.
std::vector<std::vector<Eigen::Isometry3d>> recorded_poses(const std::filesystem::path& data,
                                                           std::size_t count) {
  const test::Npy poses = test::read_npy((data / "poses/traj.npy").string());
  std::vector<std::vector<Eigen::Isometry3d>> X_FL(count);
  for (std::size_t k = 0; k < count; ++k) {
    for (std::size_t link = 0; link < test::kPandaLinks; ++link) {
      Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
      for (int i = 0; i < 12; ++i) {
        X.matrix()(i / 4, i % 4) =
            poses.values.at((k * test::kPandaLinks + link) * 12 + static_cast<std::size_t>(i));
      }
      X.linear() = Eigen::Quaterniond(X.linear()).normalized().toRotationMatrix();
      X_FL[k].push_back(X);
    }
  }
  return X_FL;
}

}  // namespace

std::vector<MovingScene> analytic_scenes() {
  using Eigen::Vector3d;
  const Vector3d x = Vector3d::UnitX(), y = Vector3d::UnitY(), z = Vector3d::UnitZ();
  const TriangleMesh bar = tessellate(Box{{0.3, 0.06, 0.06}}).mesh;
  const TriangleMesh rod = tessellate(Cylinder{0.04, 0.3}, 1e-4).mesh;
  std::mt19937_64 rng(17);
  std::vector<MovingScene> scenes;
  Points points;
  add_plate({0, 0, -0.15}, 0.6 * x, 0.6 * y, &rng, &points);
  add_plate({0, 0, 0.15}, 0.6 * x, 0.6 * y, &rng, &points);
  scenes.push_back(analytic("bar between two walls", bar, points,
                            {pose({0, 0, -0.06}, {0, 0, 0}), pose({0.1, 0, 0.06}, {0, 0.1, 0.5})}));
  points.clear();
  add_surface(
      4.0 * EIGEN_PI * 0.15 * 0.15,
      [](double u, double v) {
        const double c = 2.0 * v - 1.0, s = std::sqrt(1.0 - c * c);
        return Vector3d(0.15 * s * std::cos(2.0 * EIGEN_PI * u),
                        0.15 * s * std::sin(2.0 * EIGEN_PI * u), 0.15 * c);
      },
      &rng, &points);
  scenes.push_back(analytic("rod past a sphere", rod, points,
                            {pose({-0.4, 0, 0.22}, {0, 0, 0}), pose({0, 0.02, 0.34}, {0.4, 1.2, 0}),
                             pose({0.4, 0.1, 0.2}, {0.8, 2.0, 0.3})}));
  points.clear();
  add_plate({0.3, 0.3, 0}, 0.6 * x, 0.6 * y, &rng, &points);
  add_plate({0.3, 0, 0.3}, 0.6 * x, 0.6 * z, &rng, &points);
  add_plate({0, 0.3, 0.3}, 0.6 * y, 0.6 * z, &rng, &points);
  scenes.push_back(
      analytic("bar into a corner", bar, points,
               {pose({0.45, 0.4, 0.2}, {0, 0, 0.5}), pose({0.25, 0.15, 0.1}, {0.5, 0, 0}),
                pose({0.2, 0.4, 0.3}, {0.5, 0.7, 0.9})}));
  // Down into the plate, along it and round, and up again.
  points.clear();
  add_plate({0, 0, 0}, 0.6 * x, 0.6 * y, &rng, &points);
  scenes.push_back(
      analytic("bar dips into a plate", bar, points,
               {pose({-0.1, 0, 0.05}, {0, 0, 0}), pose({-0.05, 0, 0.015}, {0, 0.1, 0.2}),
                pose({0.05, 0.05, 0.01}, {0.3, 0.1, 0.6}), pose({0.1, 0.1, 0.06}, {0.4, 0, 0.8})}));
  return scenes;
}

std::vector<MovingScene> recorded_scenes(const std::filesystem::path& data) {
  constexpr std::size_t kPoses = 2000, kStretches = 10, kLength = 25, kWidth = 640;
  const std::vector<std::vector<Eigen::Isometry3d>> trajectory = recorded_poses(data, kPoses);
  Eigen::Isometry3d X_FS = Eigen::Isometry3d::Identity();
  std::ifstream file(data / "clouds/T_base_cam.txt");
  for (int i = 0; i < 16; ++i) file >> X_FS.matrix()(i / 4, i % 4);

  std::vector<MovingScene> scenes;
  for (const char* name : {"mosd0", "mosd10", "mosd40"}) {
    MovingScene scene;
    scene.name = std::string("recorded, ") + name;
    scene.robot.name = "panda";
    for (std::size_t i = 0; i < test::kPandaLinks; ++i) {
      const auto mesh = data / "robots/franka_description/meshes/visual" /
                        (std::string(test::panda_mesh(i)) + ".dae");
      LinkDescription link;
      link.name = test::panda_mesh(i) + std::to_string(i);
      link.geometry = {
          GeometryElement{load_mesh(mesh.string()), Eigen::Isometry3d::Identity(), mesh.string()}};
      scene.robot.links.push_back(std::move(link));
    }
    // Twice the points: one more between each two neighbours of a row that are on one surface.
    const auto pixels = test::read_pcd((data / "clouds" / (std::string(name) + ".pcd")).string());
    Points all, half, twice;
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      if (!pixels[i].allFinite()) continue;
      const Eigen::Vector3d p = X_FS * pixels[i].cast<double>();
      all.push_back(p);
      twice.push_back(p);
      if (i % 2 == 0) half.push_back(p);
      if ((i + 1) % kWidth == 0 || !pixels[i + 1].allFinite()) continue;
      const Eigen::Vector3d next = X_FS * pixels[i + 1].cast<double>();
      if ((next - p).norm() < kNeighbours) twice.push_back(0.5 * (p + next));
    }
    scene.cloud = ingested(all);
    scene.half = ingested(half);
    scene.twice = ingested(twice);
    for (std::size_t k = 0; k < kStretches; ++k) {
      const auto first = trajectory.begin() + static_cast<std::ptrdiff_t>(k * kPoses / kStretches);
      set_steps({first, first + kLength}, &scene);
    }
    scene.reference_begin = scene.steps.size() / 2;
    scene.reference_count = 60;
    scenes.push_back(std::move(scene));
  }
  return scenes;
}

std::vector<std::shared_ptr<const ContactGeometry>> pack_disjoint(
    const RobotDescription& robot, const RobotModel& model, std::size_t spheres,
    const std::string& cache_directory) {
  ContactConfig config;
  config.packing.max_spheres = spheres;
  std::vector<std::shared_ptr<const ContactGeometry>> bodies;
  for (std::size_t i = 0; i < robot.links.size(); ++i) {
    bodies.push_back(build_contact_geometry(robot.links[i].geometry, 0, model.links[i], config,
                                            cache_directory));
  }
  return bodies;
}

std::shared_ptr<const RobotModel> pack(const RobotDescription& robot, double max_error,
                                       const std::string& cache_directory) {
  RobotModelConfig config;
  config.packing.max_error = max_error;
  config.cache_directory = cache_directory;
  return build_robot_model(robot, config);
}

}  // namespace ist::benchmark
