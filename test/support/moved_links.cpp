#include "support/moved_links.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <vector>

#include "ist_proximity/proximity/proximity_query.h"
#include "support/box_oracle.h"
#include "support/distance_fields.h"
#include "support/meshes.h"
#include "support/random_links.h"
#include "support/scene.h"
#include "support/shape_oracle.h"

namespace ist::test {
namespace {

constexpr double kRounding = 2e-8;  // [m] of double precision, and of the side of a mesh

struct MovedLink {
  LinkGeometry geometry;
  double radius = 0.0;                                      // [m] of a sphere; 0: of another shape
  std::array<std::shared_ptr<const RobotModel>, 2> models;  // without and with a distance field
};

std::vector<MovedLink> make_links() {
  std::vector<MovedLink> links;
  const auto add = [&](const Shape& shape, double radius = 0.0) {
    MovedLink link;
    link.geometry = one(shape);
    link.radius = radius;
    link.models[0] = model_of({link.geometry}, 0.01);
    link.models[1] = with_fields(link.models[0]);
    links.push_back(link);
  };
  for (const double r : {0.02, 0.03, 0.05, 0.08}) {
    add(Box{{r, 2.0 * r, 3.0 * r}});
    add(Cylinder{r, 3.0 * r});
    add(Sphere{r}, r);
  }
  add(box({0.1, 0.06, 0.2}));
  add(open_box({0.1, 0.1, 0.16}));
  add(l_shape(0.15, 0.04));
  return links;
}

// One link, its obstacles, and what they are asked about.
struct Scene {
  const MovedLink* link;
  std::shared_ptr<const RobotModel> model;
  QueryConfig config;
  std::vector<Eigen::Vector3d> points;     // [m] in the fixed frame, as stored
  std::vector<Eigen::AlignedBox3d> boxes;  // [m] of a map, in the fixed frame
  CloudSnapshot snapshot;
  Eigen::Vector3d to_cluster;

  double truth(const Eigen::Isometry3d& X_FL) const {
    if (boxes.empty()) return oracle_minimum(link->geometry, X_FL, points);
    double least = std::numeric_limits<double>::infinity();
    for (const Eigen::AlignedBox3d& leaf : boxes) {
      least = std::min(least, leaf.exteriorDistance(X_FL.translation()) - link->radius);
    }
    return least;
  }
};

Eigen::Vector3d random_direction(Rng* rng) { return random_vector(rng, 1.0).normalized(); }

// A shell about the origin, from some height up, and a cluster that is as near.
std::vector<Eigen::Vector3d> shell_and_cluster(Rng* rng, const Eigen::Vector3d& to_cluster,
                                               double density) {
  const double radius = uniform(rng, 0.25, 0.7), thickness = uniform(rng, 0.0, 0.1);
  const double lowest = uniform(rng, -0.9, 0.6);
  std::vector<Eigen::Vector3d> points;
  const auto shell = static_cast<std::size_t>(density * uniform(rng, 1200.0, 2700.0));
  while (points.size() < shell) {
    const Eigen::Vector3d u = random_direction(rng);
    if (u.z() >= lowest) points.push_back((radius + thickness * uniform(rng, 0.0, 1.0)) * u);
  }
  const double distance = radius + uniform(rng, -0.02, 0.06);
  const std::size_t all = shell + static_cast<std::size_t>(density * 1100.0);
  while (points.size() < all) {
    points.push_back(distance * to_cluster + random_vector(rng, 0.001));
  }
  return points;
}

Scene make_scene(const std::vector<MovedLink>& links, Rng* rng) {
  Scene scene;
  const auto pick = [&](std::size_t n) { return static_cast<std::size_t>((*rng)() % n); };
  scene.link = &links[pick(links.size())];
  scene.model = scene.link->models[std::min<std::size_t>(pick(4), 1)];
  scene.config.max_distance = 1.0;
  scene.config.tolerance = pick(2) == 0 ? 0.0 : 0.001;
  scene.to_cluster = random_direction(rng);
  const bool is_mesh = std::holds_alternative<TriangleMesh>(scene.link->geometry.front().shape);
  auto points = shell_and_cluster(rng, scene.to_cluster, is_mesh ? 0.3 : 1.0);
  if (scene.link->radius > 0.0 && pick(2) == 0) {
    constexpr double kLeaf = 0.0078125;  // [m] a power of two: leaves are stored without rounding
    for (const Eigen::Vector3d& p : points) {
      const Eigen::Vector3d low = kLeaf * (p / kLeaf).array().floor().matrix();
      scene.boxes.emplace_back(low, low + Eigen::Vector3d::Constant(kLeaf));
    }
    scene.snapshot = make_map(scene.boxes);
  } else {
    scene.snapshot =
        make_snapshot(points, Eigen::Vector3d(0.0, 0.0, std::round(uniform(rng, 1, 3))));
    scene.points = stored_points(scene.snapshot.index);
  }
  return scene;
}

Eigen::Isometry3d turned(const Eigen::Isometry3d& X_FL, Rng* rng, double angle) {
  return X_FL * Eigen::AngleAxisd(uniform(rng, 0.0, angle), random_direction(rng));
}

// Steps aside, which a front outlives, then one towards the cluster, which turns the planes, then
// steps of any length and a teleport.
std::vector<Eigen::Isometry3d> make_motion(const Eigen::Vector3d& to_cluster, Rng* rng) {
  const Eigen::Vector3d aside = to_cluster.unitOrthogonal();
  const double way = uniform(rng, 0.03, 0.095);
  Eigen::Isometry3d start = random_pose(rng, 0.0);
  start.translation() = -0.5 * way * to_cluster;
  std::vector<Eigen::Isometry3d> poses;
  for (int k = 4; k >= 0; --k) {
    poses.push_back(start);
    poses.back().translation() -= 0.0265 * k * aside;
  }
  poses.push_back(turned(start, rng, 0.1));
  poses.back().translation() = 0.5 * way * to_cluster;
  for (int k = 0; k < 4; ++k) {
    const double step = std::pow(10.0, uniform(rng, -4.0, -1.0));
    poses.push_back(turned(poses.back(), rng, 3.0 * step));
    poses.back().translation() += step * random_direction(rng);
  }
  poses.push_back(random_pose(rng, 0.15));
  return poses;
}

void judge(const Scene& scene, const Eigen::Isometry3d& X_FL, const LinkProximity& answer,
           std::uint64_t seed, MovedLinksReport* report) {
  const double truth = scene.truth(X_FL);
  const double tolerance = scene.config.tolerance;
  ++report->answers;
  const double bound_excess = answer.lower_bound - truth - kRounding;
  report->wrong_bounds += bound_excess > 0.0 ? 1 : 0;
  if (bound_excess > report->bound_excess) {
    report->bound_excess = bound_excess;
    report->worst_seed = seed;
  }
  const auto raise = [](double value, double* worst) { *worst = std::max(*worst, value); };
  // A map has no depth in its boxes: what touches one is in contact.
  if (truth > scene.config.max_distance || (!scene.boxes.empty() && truth < 0.0)) return;
  raise(std::abs(answer.distance - truth - 0.5 * tolerance) - 0.5 * tolerance - kRounding,
        &report->distance_excess);
  raise(answer.distance - answer.lower_bound - tolerance - 1e-6, &report->width_excess);
}

}  // namespace

MovedLinksReport search_moved_links(std::uint64_t seed, std::int64_t count) {
  const std::vector<MovedLink> links = make_links();
  MovedLinksReport report;
  for (std::int64_t i = 0; i < count; ++i) {
    const std::uint64_t scene_seed = seed + static_cast<std::uint64_t>(i);
    Rng rng(scene_seed);
    const Scene scene = make_scene(links, &rng);
    ProximityQuery query(scene.model, scene.config);
    for (const Eigen::Isometry3d& X_FL : make_motion(scene.to_cluster, &rng)) {
      LinkProximity answer;
      query.run_link(0, X_FL, {&scene.snapshot}, &answer);
      judge(scene, X_FL, answer, scene_seed, &report);
    }
  }
  return report;
}

}  // namespace ist::test
