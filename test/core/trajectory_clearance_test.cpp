// The clearance along a trajectory, against dense sampling of the controllers' polynomials.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "ist_proximity/facade/robot.h"
#include "ist_proximity/proximity/joint_trajectory.h"
#include "ist_proximity/proximity/time_of_impact.h"
#include "support/motions.h"
#include "support/sanitizers.h"
#include "support/shape_oracle.h"

namespace ist {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

// A joint's position by Hermite's formulas, not by Bezier points as the library has it.
double position(const JointTrajectory& path, std::size_t joint, double time) {
  std::size_t k = 0;
  while (k + 2 < path.times.size() && path.times[k + 1] < time) ++k;
  const double T = path.times[k + 1] - path.times[k], t = time - path.times[k], s = t / T;
  const double p = path.positions[k][joint], q = path.positions[k + 1][joint];
  if (path.velocities.empty()) return p + s * (q - p);
  const double v = path.velocities[k][joint], w = path.velocities[k + 1][joint];
  if (path.accelerations.empty()) {
    const double c2 = (3.0 * (q - p) - (2.0 * v + w) * T), c3 = (2.0 * (p - q) + (v + w) * T);
    return p + v * t + s * s * (c2 + s * c3);
  }
  const double a = path.accelerations[k][joint], b = path.accelerations[k + 1][joint];
  const double d = q - p;
  const double c3 = (20.0 * d - (8.0 * w + 12.0 * v) * T - (3.0 * a - b) * T * T) / 2.0;
  const double c4 = (-30.0 * d + (14.0 * w + 16.0 * v) * T + (3.0 * a - 2.0 * b) * T * T) / 2.0;
  const double c5 = (12.0 * d - 6.0 * (w + v) * T - (a - b) * T * T) / 2.0;
  return p + v * t + 0.5 * a * t * t + s * s * s * (c3 + s * (c4 + s * c5));
}

struct Scene {
  test::ArmMotion motion;  // its base and points; its joints are not read
  JointTrajectory path;

  double end() const { return path.times.back(); }
  // The motion stands where the trajectory is.
  test::ArmMotion at(double time) const {
    test::ArmMotion still = motion;
    still.joints.duration = 1.0;
    for (std::size_t j = 0; j < still.joints.from.size(); ++j) {
      still.joints.from[j] = still.joints.to[j] = position(path, j, time);
    }
    return still;
  }
};

// Up to six waypoints over 1 to 3 s; straight, cubic or quintic.
Scene random_scene(test::Rng* rng, const test::Arm& arm) {
  Scene scene;
  scene.motion = test::random_motion(rng, arm);
  const auto& joints = arm.kinematics->joints();
  const int count = 2 + static_cast<int>(test::uniform(rng, 0, 4.999));
  const int kind = static_cast<int>(test::uniform(rng, 0, 2.999));
  const std::vector<double> start = scene.motion.joints.from;
  double time = test::uniform(rng, -1.0, 1.0);
  std::vector<double> at = start;
  for (int k = 0; k < count; ++k) {
    std::vector<double> velocity, acceleration;
    for (std::size_t j = 0; j < at.size(); ++j) {
      const double way = joints[j].type == JointType::kPrismatic ? 0.2 : 1.0;
      const bool pauses = k > 1 && test::uniform(rng, 0, 1) < 0.3;
      if (k > 0 && !pauses && !std::isnan(start[j])) at[j] += test::uniform(rng, -way, way);
      const bool is_end = k == 0 || k + 1 == count;
      velocity.push_back(is_end ? 0.0 : test::uniform(rng, -way, way));
      acceleration.push_back(is_end ? 0.0 : 3.0 * test::uniform(rng, -way, way));
    }
    scene.path.times.push_back(time);
    scene.path.positions.push_back(at);
    if (kind > 0) scene.path.velocities.push_back(velocity);
    if (kind > 1) scene.path.accelerations.push_back(acceleration);
    time += test::uniform(rng, 0.2, 1.0);
  }
  for (Eigen::Vector3d& point : scene.motion.points) {
    const double when = test::uniform(rng, scene.path.times.front() + 0.2, scene.end() + 0.3);
    const std::size_t body = arm.bodies[test::random_link(rng, arm)];
    const auto poses = test::sampled_poses(arm, scene.at(std::min(when, scene.end())), 0.5);
    point = poses[body] * test::random_vector(rng, 0.1);
  }
  return scene;
}

// Where a trajectory is begun, and how obstacles come nearer.
struct Watch {
  double from, speed, age;  // [s], [m/s], [s]

  double come(double time) const { return speed * (time - from + age); }
};

// From a time within the trajectory in one of three, with obstacles that come in one of two.
Watch random_watch(test::Rng* rng, const Scene& scene) {
  Watch watch{scene.path.times[0], 0.0, 0.0};
  if (test::uniform(rng, 0, 1) < 0.3) watch.from = test::uniform(rng, watch.from, scene.end());
  if (test::uniform(rng, 0, 1) < 0.5) return watch;
  watch.speed = test::uniform(rng, 0.0, test::uniform(rng, 0.0, 3.0));
  watch.age = test::uniform(rng, 0.0, 0.2);
  return watch;
}

struct Sampled {
  double contact = kInf, least = kInf;  // [s], [m] until then
};

Sampled sample(const test::Arm& arm, const Scene& scene, const Watch& watch) {
  constexpr double kStep = 5e-4, kFastest = 40.0;
  Sampled sampled;
  for (double time = watch.from; time <= scene.end();) {
    const double distance = test::sampled_distance(arm, scene.at(time), 0.5) - watch.come(time);
    sampled.least = std::min(sampled.least, distance);
    if (distance <= 0.0) {
      sampled.contact = time;
      break;
    }
    time += kStep * std::max(1.0, std::floor(distance / (kFastest * kStep)));
  }
  return sampled;
}

TEST(TrajectoryClearance, piecesStayNearThePolynomials) {
  test::Rng rng(5);
  double largest = 0.0;
  for (int i = 0; i < 200; ++i) {
    const test::Arm arm = test::random_arm(&rng);
    const Scene scene = random_scene(&rng, arm);
    const StraightPieces pieces = straight_pieces(scene.path);
    ASSERT_EQ(pieces.positions.size(), pieces.times.size());
    ASSERT_EQ(pieces.deviations.size() + 1, pieces.times.size());
    for (std::size_t k = 0; k + 1 < pieces.times.size(); ++k) {
      ASSERT_LT(pieces.times[k], pieces.times[k + 1]);
      for (const double s : {0.0, 0.2, 0.5, 0.9, 1.0}) {
        const double time = (1.0 - s) * pieces.times[k] + s * pieces.times[k + 1];
        for (std::size_t j = 0; j < pieces.positions[k].size(); ++j) {
          const double exact = position(scene.path, j, time);
          if (std::isnan(exact)) continue;
          const double straight =
              (1.0 - s) * pieces.positions[k][j] + s * pieces.positions[k + 1][j];
          const double off = std::abs(exact - straight);
          ASSERT_LE(off, pieces.deviations[k][j] + 1e-12);
          largest = std::max(largest, off);
        }
      }
    }
  }
  EXPECT_GT(largest, 1e-4);
}

// While time slows down from 1 to 0 steadily, no joint accelerates more than it can.
TEST(TrajectoryClearance, brakingTakesWhatJointsCan) {
  test::Rng rng(9);
  int braked = 0;
  double least_rest = kInf;
  for (int i = 0; i < 300; ++i) {
    const test::Arm arm = test::random_arm(&rng);
    const Scene scene = random_scene(&rng, arm);
    const double deceleration = test::uniform(&rng, 2.0, 30.0);
    const double from = test::uniform(&rng, scene.path.times[0], scene.end());
    const double until = test::uniform(&rng, from, scene.end());
    const double way =
        braking_way(straight_pieces(scene.path), from, until,
                    std::vector<double>(arm.kinematics->joints().size(), deceleration));
    if (way == 0.0 || way > until - from) continue;
    ++braked;
    // Time runs at sqrt(1 - u) where a share u of the way is gone, from a begin on until it stands.
    const double begin = test::uniform(&rng, from, until - way), rate = 0.5 / way;
    constexpr double kStep = 1e-4;
    for (double u = 0.0; u < 1.0; u += 0.05) {
      const double time = begin + u * way;
      if (time - kStep < from || time + kStep > until) continue;
      const auto& times = scene.path.times;
      const auto corner = std::lower_bound(times.begin(), times.end(), time - kStep);
      if (corner != times.end() && *corner <= time + kStep) continue;  // velocities may jump
      for (std::size_t j = 0; j < scene.path.positions[0].size(); ++j) {
        const double before = position(scene.path, j, time - kStep);
        const double after = position(scene.path, j, time + kStep);
        if (std::isnan(before)) continue;
        const double velocity = (after - before) / (2.0 * kStep);
        const double acceleration =
            (after - 2.0 * position(scene.path, j, time) + before) / (kStep * kStep);
        const double asked = std::abs(acceleration * (1.0 - u) - velocity * rate);
        ASSERT_LE(asked, deceleration + 1e-3);
        least_rest = std::min(least_rest, deceleration - asked);
      }
    }
  }
  EXPECT_GT(braked, 50);
  EXPECT_LT(least_rest, 0.1);
}

// The earliest contact of all links, and the smallest bound.
LinkClearance clearance_of(TimeOfImpact* impacts, const StraightPieces& pieces, const Scene& scene,
                           const Watch& watch, const CloudSnapshot& cloud, std::size_t links) {
  std::vector<LinkClearance> found;
  impacts->run(pieces, watch.from, scene.motion.still, scene.motion.X_FR,
               std::vector<bool>(links, true), {&cloud}, {}, watch.speed, watch.age, &found);
  LinkClearance all;
  all.contact_time = kInf;
  for (const LinkClearance& one : found) {
    EXPECT_FALSE(std::isnan(one.contact_time));
    all.contact_time = std::min(all.contact_time, one.contact_time);
    all.lower_bound = std::fmin(all.lower_bound, one.lower_bound);
  }
  return all;
}

TEST(TrajectoryClearance, neverLateAndHardlyEarly) {
  test::Rng rng(6);
  constexpr double kFar = 3.0;  // [m]
  int trajectories = 0, contacts = 0, close = 0, tight = 0, free = 0;
  while (trajectories < test::scaled(1000)) {
    const test::Arm arm = test::random_arm(&rng);
    QueryConfig config;
    config.max_distance = kFar;
    TimeOfImpact impacts(arm.model, arm.kinematics, config);
    for (int i = 0; i < 20; ++i) {
      const Scene scene = random_scene(&rng, arm);
      const Watch watch = random_watch(&rng, scene);
      const auto distance = [&](double time) {
        return test::sampled_distance(arm, scene.at(time), 0.5) - watch.come(time);
      };
      const CloudSnapshot cloud = test::make_snapshot(scene.motion.points);
      const LinkClearance all =
          clearance_of(&impacts, straight_pieces(scene.path), scene, watch, cloud, arm.size());
      // Pieces that are far from the polynomials are early, and not wrong.
      const LinkClearance coarse =
          clearance_of(&impacts, straight_pieces(scene.path, 0.1), scene, watch, cloud, arm.size());
      const Sampled truth = sample(arm, scene, watch);
      ASSERT_LE(coarse.contact_time, truth.contact) << "late";
      ASSERT_LE(all.contact_time, truth.contact) << "late";
      const double until =
          all.contact_time < kInf ? std::max(distance(all.contact_time), 0.0) : truth.least;
      ASSERT_LE(all.lower_bound, until + 1e-9) << "too far";
      ++trajectories;
      const bool is_in_time =
          all.contact_time == truth.contact || truth.contact - all.contact_time <= 0.02;
      const bool is_near = all.contact_time < kInf && until <= 0.005;
      close += is_in_time || is_near ? 1 : 0;
      contacts += truth.contact < kInf ? 1 : 0;
      if (truth.contact < kInf) continue;
      ++free;
      const double least = std::min(truth.least, kFar);
      tight += all.lower_bound >= std::min(0.75 * least, least - 0.002) - 0.012 ? 1 : 0;
    }
  }
  EXPECT_GE(close, 0.99 * trajectories);
  EXPECT_GE(tight, 0.99 * free);
  EXPECT_GT(contacts, trajectories / 4);
  EXPECT_GT(free, trajectories / 10);
}

// One piece, whose chord stands still: all of the motion is deviation, of the joint that follows
// too.
TEST(TrajectoryClearance, jointsThatFollowLeaveTheChord) {
  const Robot robot(R"(<robot name="two"><link name="base"/>
    <link name="led"/><link name="ball"><collision><geometry><sphere radius="0.1"/></geometry>
    </collision></link>
    <joint name="lead" type="prismatic"><parent link="base"/><child link="led"/><axis xyz="1 0 0"/>
      <limit lower="-1" upper="1" velocity="1" effort="1"/></joint>
    <joint name="follow" type="prismatic"><parent link="base"/><child link="ball"/>
      <axis xyz="1 0 0"/><limit lower="-3" upper="3" velocity="1" effort="1"/>
      <mimic joint="lead" multiplier="-3"/></joint></robot>)");
  JointTrajectory path;
  path.times = {0.0, 1.0};
  path.positions.assign(2, std::vector<double>(2, std::nan("")));
  path.velocities = path.positions;
  const std::size_t lead = *robot.kinematics()->find_joint("lead");
  path.positions[0][lead] = path.positions[1][lead] = 0.0;
  path.velocities[0][lead] = 1.0;  // 0.25 m at half the time
  path.velocities[1][lead] = -1.0;
  JointPoses still;
  robot.kinematics()->place_joints(path.positions[0], &still);
  const CloudSnapshot cloud = test::make_snapshot({Eigen::Vector3d(-0.7, 0.0, 0.0)});
  TimeOfImpact impacts(robot.model(), robot.kinematics(), QueryConfig());
  for (const double deviation : {10.0, 1e-3}) {
    std::vector<LinkClearance> found;
    impacts.run(straight_pieces(path, deviation), 0.0, still, Eigen::Isometry3d::Identity(), {true},
                {&cloud}, {}, 0.0, 0.0, &found);
    const double touch = 0.5 - std::sqrt(0.25 - 0.2);  // 3 t (1 - t) is 0.6
    EXPECT_LE(found[0].contact_time, touch);
    EXPECT_GE(found[0].contact_time, deviation < 1.0 ? touch - 0.02 : 0.0);
  }
}

TEST(TrajectoryClearance, whatIsNotKnownIsNotFree) {
  test::Rng rng(8);
  const test::Arm arm = test::random_arm(&rng);
  const Scene scene = random_scene(&rng, arm);
  const CloudSnapshot cloud = test::make_snapshot(scene.motion.points);
  TimeOfImpact impacts(arm.model, arm.kinematics, QueryConfig());
  const StraightPieces pieces = straight_pieces(scene.path);
  const std::vector<bool> all(arm.size(), true);
  const auto run = [&](const StraightPieces& path, SnapshotSpan clouds, double speed) {
    std::vector<LinkClearance> found;
    impacts.run(path, pieces.times[0], scene.motion.still, scene.motion.X_FR, all, clouds, {},
                speed, 0.0, &found);
    EXPECT_EQ(found.size(), arm.size());
    return std::all_of(found.begin(), found.end(), [](const LinkClearance& one) {
      return std::isnan(one.contact_time) && std::isnan(one.lower_bound);
    });
  };
  EXPECT_FALSE(run(pieces, {&cloud}, 0.0));
  EXPECT_TRUE(run(pieces, {}, 0.0)) << "no cloud";
  EXPECT_TRUE(run({}, {&cloud}, 0.0)) << "no trajectory";
  EXPECT_TRUE(run(pieces, {&cloud}, -1.0));
  EXPECT_TRUE(run(pieces, {&cloud}, std::nan("")));
  StraightPieces broken = pieces;
  broken.times.back() = broken.times[broken.times.size() - 2];
  EXPECT_TRUE(pieces.times.size() > 2 || run(broken, {&cloud}, 0.0)) << "time stands still";
  broken = pieces;
  broken.positions.back().pop_back();
  EXPECT_TRUE(run(broken, {&cloud}, 0.0)) << "a joint is missing";
  for (const double wrong : {std::nan(""), kInf, 1e12}) {
    for (const std::size_t row : {std::size_t{0}, pieces.positions.size() - 1}) {
      broken = pieces;
      const auto joint = std::find_if(broken.positions[0].begin(), broken.positions[0].end(),
                                      [](double q) { return std::isfinite(q); });
      ASSERT_NE(joint, broken.positions[0].end());
      broken.positions[row][static_cast<std::size_t>(joint - broken.positions[0].begin())] = wrong;
      EXPECT_TRUE(run(broken, {&cloud}, 0.0)) << "position " << wrong << " in row " << row;
    }
    broken = pieces;
    broken.deviations[0][0] = wrong;
    EXPECT_TRUE(run(broken, {&cloud}, 0.0)) << "deviation " << wrong;
  }
}

constexpr const char* kSlide = R"(<robot name="one"><link name="base"/>
    <link name="ball"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
    <joint name="slide" type="prismatic"><parent link="base"/><child link="ball"/>
      <axis xyz="1 0 0"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>)";

// One point is a trajectory, and what is left of another one at its end.
TEST(TrajectoryClearance, theEndIsMeasured) {
  const Robot robot(kSlide);
  JointPoses still;
  robot.kinematics()->place_joints({0.0}, &still);
  TimeOfImpact impacts(robot.model(), robot.kinematics(), QueryConfig());
  for (const double x : {0.35, 0.25}) {
    const CloudSnapshot cloud = test::make_snapshot({Eigen::Vector3d(x, 0.0, 0.0)});
    const StraightPieces point{{0.0}, {{0.2}}, {}}, way{{0.0, 1.0}, {{0.0}, {0.2}}, {{0.0}}};
    for (const auto& [pieces, from] :
         {std::pair(point, 0.0), std::pair(point, 1e12), std::pair(way, 1.0)}) {
      std::vector<LinkClearance> found;
      impacts.run(pieces, from, still, Eigen::Isometry3d::Identity(), {true}, {&cloud}, {}, 0.0,
                  0.0, &found);
      EXPECT_EQ(found[0].contact_time, x < 0.3 ? from : kInf);
      EXPECT_LE(found[0].lower_bound, x - 0.3);
      EXPECT_GE(found[0].lower_bound, x - 0.3 - 0.0126);
    }
  }
}

TEST(TrajectoryClearance, gradientsOfTheDistanceWhereItIsLeast) {
  const Robot robot(kSlide);
  const JointTrajectory path{{0.0, 1.0}, {{0.0}, {0.2}}, {}, {}};
  const Eigen::Vector3d point(0.5, 0.4, 0.0);
  const Obstacles obstacles(std::vector<Eigen::Vector3d>{point});
  const LinkClearance found = robot.clearance({&path, 1}, obstacles)[0];
  ASSERT_EQ(found.gradient.size(), 1U);
  const double x = 0.2 * found.nearest_time;
  EXPECT_NEAR(found.gradient[0], (x - 0.5) / std::hypot(x - 0.5, 0.4), 1e-6);  // points are floats
  const Obstacles far(std::vector<Eigen::Vector3d>{{30.0, 0.0, 0.0}});
  EXPECT_TRUE(robot.clearance({&path, 1}, far)[0].gradient.empty());
}

// Velocities whose sums overflow leave no bound of where the joint is.
TEST(TrajectoryClearance, hugeNumbersAreNotFree) {
  const Robot robot(kSlide);
  const Obstacles obstacles(std::vector<Eigen::Vector3d>{{0.5, 0.0, 0.0}});
  for (const double huge : {1e3, 1e12, 1e100, 1e308}) {
    for (const double sign : {-1.0, 1.0}) {
      JointTrajectory path{{0.0, 10.0}, {{0.0}, {0.0}}, {{huge}, {sign * huge}}, {}};
      const LinkClearance found = robot.clearance({&path, 1}, obstacles)[0];
      EXPECT_FALSE(found.contact_time > 0.01) << huge << " " << sign;
    }
  }
}

}  // namespace
}  // namespace ist
