#include "scene.h"
#include "internal/geometry/solid_queries.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "simulation.h"

namespace ist::sim {
namespace {

constexpr double kNominalStep = 0.01;  // [s]
constexpr int kTries = 10000;
const Eigen::Vector3d kShoulder(0.0, 0.0, 0.135);  // [m] where the demo arm's first axes meet

double uniform(Rng* rng, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(*rng);
}

[[noreturn]] void give_up(const char* what) {
  throw std::runtime_error(std::string("no ") + what + " that keeps the rules of the scene.");
}

// Goals above the bench, on both sides of it.
Eigen::VectorXd random_goal(Rng* rng) {
  Eigen::VectorXd q(6);
  q << uniform(rng, -1.2, 1.2), uniform(rng, -0.2, 0.9), uniform(rng, 0.5, 1.6),
      uniform(rng, -1.0, 1.0), uniform(rng, -0.8, 0.8), uniform(rng, -1.5, 1.5);
  return q;
}

// Goals beside the bench: the arm is folded below its base, and its wrist swings the gripper from
// one side of the stand to the other.
bool choose_folded_goals(const SceneRules& rules, Rng* rng, Eigen::VectorXd* a,
                         Eigen::VectorXd* b) {
  constexpr double kApart = 0.02;  // [m]
  const double wrist = uniform(rng, 0.6, 1.3);
  *a = Eigen::VectorXd(6);
  *a << uniform(rng, 1.5, 2.7), uniform(rng, 1.6, 1.9), uniform(rng, 1.9, 2.2),
      0.5 * M_PI + uniform(rng, -0.3, 0.3), wrist, uniform(rng, -1.5, 1.5);
  *b = *a;
  (*b)[4] = -wrist;
  return rules.own_distance(0.5 * (*a + *b)) <= 0.0 && rules.own_distance(*a) > kApart &&
         rules.own_distance(*b) > kApart;
}

bool way_is_clear(Simulation* world, const Eigen::VectorXd& a, const Eigen::VectorXd& b,
                  double clearance) {
  for (int k = 0; k <= 20; ++k) {
    world->arm().reset(a + 0.05 * k * (b - a));
    if (world->nearest(clearance).distance < clearance) return false;
  }
  return true;
}

void choose_goals(Simulation* world, const SceneRules& rules, Rng* rng, Scene* scene) {
  for (int k = 0; k < kTries; ++k) {
    Eigen::VectorXd a, b;
    if (rules.own_distance) {
      if (!choose_folded_goals(rules, rng, &a, &b)) continue;
    } else {
      a = random_goal(rng);
      b = random_goal(rng);
      if (std::abs(a[0] - b[0]) < 0.8) continue;
    }
    if (!way_is_clear(world, a, b, rules.goal_clearance)) continue;
    scene->goals = {a, b};
    return;
  }
  give_up("goals");
}

Eigen::Vector3d random_direction(Rng* rng, double max_slope) {
  const double z = uniform(rng, -max_slope, max_slope), angle = uniform(rng, -M_PI, M_PI);
  const double r = std::sqrt(1.0 - z * z);
  return {r * std::cos(angle), r * std::sin(angle), z};
}

Obstacle random_body(Rng* rng) {
  Obstacle body;
  if (uniform(rng, 0.0, 1.0) < 0.5) {
    body.shape = Sphere{uniform(rng, 0.05, 0.10)};
    return body;
  }
  body.shape = Box{{uniform(rng, 0.08, 0.18), uniform(rng, 0.08, 0.18), uniform(rng, 0.08, 0.18)}};
  std::normal_distribution<double> normal;
  const double w = normal(*rng), x = normal(*rng), y = normal(*rng), z = normal(*rng);
  body.R_FO = Eigen::Quaterniond(w, x, y, z).normalized().toRotationMatrix();
  return body;
}

// The length [m] from p along d to where the shoulder is `distance` away.
double exit_length(const Eigen::Vector3d& p, const Eigen::Vector3d& d, double distance) {
  const Eigen::Vector3d s = p - kShoulder;
  const double b = s.dot(d);
  return -b + std::sqrt(b * b - s.squaredNorm() + distance * distance);
}

// Whether an obstacle keeps clear of the links that cannot yield, and is in view at the arm.
bool keeps_rules(const Obstacle& body, const Simulation& world, const std::vector<Solid>& immovable,
                 const Eigen::Vector3d& aim, const SceneRules& rules) {
  const double length = (body.to - body.from).norm();
  for (double s = 0.0; s < length; s += 0.02) {
    const Eigen::Vector3d p = body.from + s / length * (body.to - body.from);
    if ((p - kShoulder).norm() < rules.hub_clearance + body.radius()) return false;
    const double near = rules.base_clearance + body.radius();
    for (const Solid& solid : immovable) {
      if (distance_outside(solid, p, near).distance < near) return false;
    }
    for (const Obstacle& other : world.obstacles()) {
      const Eigen::Vector3d p_O = other.pose(0.0).inverse() * p;
      const Eigen::Vector3d half = 0.5 * std::get<Box>(other.shape).size;
      if ((p_O.cwiseAbs() - half).cwiseMax(0.0).norm() < near) return false;
    }
    const auto sees = [&p](const DepthCamera& camera) { return camera.has_in_view(p); };
    const auto& cameras = world.cameras();
    if ((p - aim).norm() < 0.5 && !std::all_of(cameras.begin(), cameras.end(), sees)) return false;
  }
  return true;
}

std::vector<Solid> solids_of(const RobotDescription& robot) {
  std::vector<Solid> solids;
  for (const LinkDescription& link : robot.links) solids.emplace_back(link.geometry);
  return solids;
}

// [m] From the links that joints move to a body that stands, where less than `most`.
double distance_to(const Obstacle& body, const Arm& arm, const std::vector<Solid>& solids,
                   const Eigen::VectorXd& q, double most) {
  const std::vector<Eigen::Isometry3d> X_FL = arm.link_poses(q);
  for (std::size_t i = 0; i < solids.size(); ++i) {
    if (!arm.moved()[i]) continue;
    most = std::min(most, distance(solids[i], X_FL[i], body, body.pose(0.0), most));
  }
  return most;
}

void add_clutter(const SceneRules& rules, const Arm& arm, const std::vector<Solid>& solids,
                 const Simulation& world, const std::vector<Eigen::VectorXd>& motion, Rng* rng,
                 Scene* scene) {
  for (int k = 0; k < kTries; ++k) {
    Obstacle body = random_body(rng);
    const auto X_FL = arm.link_poses(motion[(*rng)() % motion.size()]);
    std::size_t link = (*rng)() % X_FL.size();
    while (!arm.moved()[link]) link = (*rng)() % X_FL.size();
    const double aside = rules.clutter_aside;
    const Eigen::Vector3d beside(uniform(rng, -aside, aside), uniform(rng, -aside, aside),
                                 uniform(rng, -aside, aside));
    body.from = world.middle(link, X_FL[link]) + beside;
    body.name = "clutter";
    const double near = rules.clutter_clearance;
    const auto is_free = [&](const Eigen::VectorXd& goal) {
      return distance_to(body, arm, solids, goal, near) >= near;
    };
    if (!std::all_of(scene->goals.begin(), scene->goals.end(), is_free)) continue;
    scene->obstacles.push_back(body);
    return;
  }
  give_up("clutter");
}

// A column of 0.4 m across: two square ones, turned by 45 degrees.
void add_person(const SceneRules& rules, double time, Rng* rng, Scene* scene) {
  constexpr double kHeight = 1.75, kFloor = -0.95, kWay = 4.0, kFromCamera = 0.6;  // [m]
  for (int k = 0; k < kTries; ++k) {
    const double angle = uniform(rng, -M_PI, M_PI);
    const Eigen::Vector3d along(std::cos(angle), std::sin(angle), 0.0);
    const Eigen::Vector3d aside(-along.y(), along.x(), 0.0);
    const Eigen::Vector3d middle = uniform(rng, rules.near_walk, rules.far_walk) * aside +
                                   Eigen::Vector3d(0.0, 0.0, kFloor + 0.5 * kHeight);
    const auto is_beside = [&](const DepthCameraConfig& camera) {
      return std::abs((camera.X_FC.translation() - middle).dot(aside)) > kFromCamera;
    };
    if (!std::all_of(scene->cameras.begin(), scene->cameras.end(), is_beside)) continue;
    for (const double turn : {0.0, 0.25 * M_PI}) {
      Obstacle column;
      column.name = "person";
      column.shape = Box{{0.37, 0.37, kHeight}};
      column.R_FO = Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ()).toRotationMatrix();
      column.from = middle - kWay * along;
      column.to = middle + kWay * along;
      column.speed = rules.walking_speed;
      column.start = time - kWay / column.speed;
      scene->obstacles.push_back(column);
    }
    return;
  }
  give_up("person");
}

}  // namespace

ArmConfig demo_arm() {
  ArmConfig config;
  config.joints = {"shoulder_yaw", "shoulder_pitch", "elbow_pitch",
                   "forearm_roll", "wrist_pitch",    "wrist_roll"};
  config.rest = 0.03;  // the jaw, half open
  return config;
}

std::vector<Obstacle> demo_surroundings() {
  Obstacle bench, floor;
  bench.name = "bench";
  bench.shape = Box{{0.80, 1.10, 0.03}};
  bench.from = {0.80, 0.0, -0.215};
  floor.name = "floor";
  floor.shape = Box{{8.0, 8.0, 0.02}};
  floor.from = {0.0, 0.0, -0.96};
  return {bench, floor};
}

std::vector<Obstacle> demo_obstacles() {
  std::vector<Obstacle> all = demo_surroundings();
  Obstacle ball, box;
  ball.name = "ball";
  ball.shape = Sphere{0.08};
  ball.from = {0.52, -1.2, 0.34};
  ball.to = {0.48, 1.2, 0.40};
  ball.speed = 0.25;
  ball.repeat = 12.0;
  box.name = "box";
  box.shape = Box{{0.12, 0.16, 0.10}};
  box.R_FO = Eigen::AngleAxisd(0.5, Eigen::Vector3d(1.0, 2.0, 2.0).normalized()).matrix();
  box.from = {1.3, -1.0, 0.42};
  box.to = {-0.1, 1.3, 0.50};
  box.start = 6.0;
  box.speed = 0.30;
  box.repeat = 12.0;
  all.push_back(ball);
  all.push_back(box);
  return all;
}

std::vector<DepthCameraConfig> demo_cameras() {
  DepthCameraConfig front, back;
  front.name = "front";
  front.X_FC = looking_at({1.50, -0.80, 0.95}, {0.15, 0.0, 0.30});
  back.name = "back";
  back.X_FC = looking_at({-0.90, 1.10, 1.00}, {0.20, 0.0, 0.30});
  return {front, back};
}

Scene make_scene(const RobotDescription& robot, std::uint64_t seed, const SceneRules& rules,
                 const std::function<std::vector<Eigen::VectorXd>(const Scene&)>& nominal) {
  Rng rng(seed);
  Scene scene;
  scene.obstacles = demo_surroundings();
  scene.cameras = demo_cameras();
  Simulation world(robot, demo_arm(), scene.obstacles, scene.cameras, seed);
  choose_goals(&world, rules, &rng, &scene);
  const std::vector<Eigen::VectorXd> motion = nominal(scene);

  std::vector<Solid> immovable;
  std::vector<std::size_t> targets;  // links distal to the elbow
  for (std::size_t i = 0; i < robot.links.size(); ++i) {
    if (!world.arm().moved()[i]) immovable.emplace_back(robot.links[i].geometry);
  }
  for (const char* name : {"forearm_link", "wrist_fork_link", "wrist_link", "gripper_link"}) {
    const auto is_it = [name](const LinkDescription& link) { return link.name == name; };
    const auto found = std::find_if(robot.links.begin(), robot.links.end(), is_it);
    targets.push_back(static_cast<std::size_t>(found - robot.links.begin()));
  }
  for (int n = 0; n < rules.obstacles; ++n) {
    bool found = false;
    for (int k = 0; k < kTries && !found; ++k) {
      Obstacle body = random_body(&rng);
      const double aim_time = rules.first_aim + n * rules.aim_interval + uniform(&rng, -0.5, 0.5);
      const auto at = static_cast<std::size_t>(aim_time / kNominalStep);
      const std::size_t target = targets[rng() % targets.size()];
      const Eigen::Isometry3d X_FL =
          world.arm().link_poses(motion[std::min(at, motion.size() - 1)])[target];
      const Eigen::Vector3d error(uniform(&rng, -1, 1), uniform(&rng, -1, 1), uniform(&rng, -1, 1));
      const Eigen::Vector3d aim = world.middle(target, X_FL) + rules.aim_error * error;
      const Eigen::Vector3d direction = random_direction(&rng, rules.max_slope);
      body.speed = uniform(&rng, rules.min_speed, rules.max_speed);
      const double before = exit_length(aim, -direction, rules.park_distance);
      body.from = aim - before * direction;
      body.to = aim + exit_length(aim, direction, rules.park_distance) * direction;
      body.start = aim_time - before / body.speed;
      body.name = "body" + std::to_string(n);
      found = keeps_rules(body, world, immovable, aim, rules);
      if (found) scene.obstacles.push_back(body);
    }
    if (!found) give_up("obstacle");
  }
  const std::vector<Solid> solids = solids_of(robot);
  for (int n = 0; n < rules.clutter; ++n) {
    add_clutter(rules, world.arm(), solids, world, motion, &rng, &scene);
  }
  for (int n = 0; n < rules.people; ++n) {
    add_person(rules, rules.first_aim + n * rules.aim_interval, &rng, &scene);
  }
  return scene;
}

Scene make_near_start(const RobotDescription& robot, std::uint64_t seed,
                      const std::function<std::vector<Eigen::VectorXd>(const Scene&)>& nominal) {
  constexpr double kLeast = 0.015, kMost = 0.045, kAway = 0.08;  // [m]
  SceneRules rules;
  rules.obstacles = 0;
  Scene scene = make_scene(robot, seed, rules, nominal);
  scene.task = 1;
  scene.duration = 0.0;
  scene.patience = 20.0;
  Rng rng(seed);
  const Arm arm(robot, demo_arm());
  const std::vector<Solid> solids = solids_of(robot);
  for (int k = 0; k < kTries; ++k) {
    Obstacle ball;
    ball.name = "ball";
    ball.shape = Sphere{0.06};
    ball.from = {uniform(&rng, -0.2, 0.9), uniform(&rng, -0.9, 0.9), uniform(&rng, -0.1, 0.9)};
    const auto at = [&](double share) {
      const Eigen::VectorXd q = scene.goals[0] + share * (scene.goals[1] - scene.goals[0]);
      return distance_to(ball, arm, solids, q, 0.5);
    };
    double last = at(0.0);
    bool leads_away = last >= kLeast && last <= kMost;
    for (int i = 1; i <= 20 && leads_away; ++i) {
      const double next = at(0.05 * i);
      leads_away = next > std::min(last, kAway);
      last = next;
    }
    if (!leads_away || last < kAway) continue;
    scene.obstacles.push_back(ball);
    return scene;
  }
  give_up("ball");
}

}  // namespace ist::sim
