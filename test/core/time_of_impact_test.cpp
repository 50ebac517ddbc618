#include "ist_proximity/proximity/time_of_impact.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "proximity/motion_bound.h"
#include "support/motions.h"
#include "support/random_links.h"
#include "support/random_robots.h"
#include "support/sanitizers.h"
#include "support/shape_oracle.h"
#include "support/worlds.h"

namespace ist {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

TimeOfImpact impacts_of(const test::Arm& arm) {
  QueryConfig config;
  config.max_distance = 0.5;
  return TimeOfImpact(arm.model, arm.kinematics, config);
}

// [s] The first time of contact of any link; infinity where there is none.
double first_impact(TimeOfImpact* impacts, const test::Arm& arm, const test::ArmMotion& motion) {
  const CloudSnapshot cloud = test::make_snapshot(motion.points);
  std::vector<ImpactTime> found;
  impacts->run(motion.joints, motion.still, motion.X_FR, std::vector<bool>(arm.size(), true),
               {&cloud}, &found);
  double first = kInf;
  for (const ImpactTime& one : found) first = std::min(first, one.time);
  return first;
}

// The time is never later than the one that dense sampling finds, and in 99 % of the motions no
// more than 5 ms earlier.
TEST(TimeOfImpact, randomMotionsAgainstDenseSampling) {
  test::Rng rng(66);
  test::ImpactCounts counts;
  while (counts.all < test::scaled(1000)) {
    const test::Arm arm = test::random_arm(&rng);
    TimeOfImpact impacts = impacts_of(arm);
    for (int i = 0; i < 25 && counts.all < test::scaled(1000); ++i) {
      const test::ArmMotion motion = test::random_motion(&rng, arm);
      const double first = first_impact(&impacts, arm, motion);
      const double truth = test::sampled_impact(arm, motion);
      if (truth == 0.0) {
        EXPECT_EQ(first, 0.0);
        continue;  // in contact from the start
      }
      counts.add(first, truth);
    }
  }
  EXPECT_EQ(counts.late, 0);
  EXPECT_GE(counts.close, 0.99 * counts.all);
  EXPECT_LE(counts.alarms, 0.01 * counts.all);
  EXPECT_GT(counts.contacts, counts.all / 4) << "motions must be hard ones";
  EXPECT_GT(counts.all - counts.contacts, counts.all / 10);
}

// Balls at points, in a frame of their own.
PosedWorld world_of_balls(const std::vector<Eigen::Vector3d>& points, double radius, double margin,
                          const Eigen::Isometry3d& X_FB) {
  std::vector<WorldObject> balls;
  for (const Eigen::Vector3d& point : points) {
    const Eigen::Isometry3d X_BO(Eigen::Translation3d(X_FB.inverse() * point));
    const std::string name = "ball " + std::to_string(balls.size());
    balls.push_back(test::object_of(name, test::one(Sphere{radius}), X_BO));
    balls.back().margin = margin;
  }
  return test::posed(balls, X_FB);
}

// The first of the times that are found, beside the exact distance.
struct Contacts {
  int contacts = 0, free = 0;

  // Nothing is touched before it, and something is then. @returns [s] a contact; +inf: none
  double expect(const std::vector<ImpactTime>& found, const std::function<double(double)>& distance,
                double duration) {
    double first = kInf;
    bool converged = true;
    for (const ImpactTime& one : found) {
      EXPECT_FALSE(std::isnan(one.time));
      converged &= one.converged;
      first = std::min(first, one.time);
    }
    if (distance(0.0) <= 0.0) {
      EXPECT_EQ(first, 0.0);
      return kInf;
    }
    const double end = std::min(first, duration);
    for (int k = 0; k <= 60; ++k) EXPECT_GT(distance(end * k / 60), -1e-9) << first << " s";
    free += first == kInf ? 1 : 0;
    if (first == kInf || !converged) return kInf;
    EXPECT_LT(distance(first), 3e-6);
    ++contacts;
    return first;
  }
};

// The times of contact with a known world.
std::vector<ImpactTime> impacts_with(const PosedWorld& world, const test::Arm& arm,
                                     const test::ArmMotion& motion) {
  TimeOfImpact impacts = impacts_of(arm);
  impacts.set_surfaces(make_robot_surfaces(arm.model), {});
  std::vector<ImpactTime> found;
  impacts.run(motion.joints, motion.still, motion.X_FR, std::vector<bool>(arm.size(), true), {},
              {&world}, &found);
  return found;
}

// No ball of a known world and no point of a cloud is touched before the time that is returned, and
// one of them is touched then.
TEST(TimeOfImpact, KnownWorldsBesideClouds) {
  constexpr double kRadius = 0.005, kMargin = 0.002;
  test::Rng rng(67);
  Contacts counts;
  int by_ball = 0;
  for (int i = 0; i < test::scaled(80); ++i) {
    const test::Arm arm = test::random_arm(&rng);
    TimeOfImpact impacts = impacts_of(arm);
    test::ArmMotion motion = test::random_motion(&rng, arm);
    test::ArmMotion balls = motion;
    if (i % 3 != 0) {  // else both
      motion.points.resize(motion.points.size() / 2);
      balls.points.erase(balls.points.begin(),
                         balls.points.begin() + static_cast<long>(motion.points.size()));
    }
    const bool has_cloud = i % 4 != 1 && !motion.points.empty();
    const CloudSnapshot cloud = test::make_snapshot(motion.points);
    const PosedWorld world =
        world_of_balls(balls.points, kRadius, kMargin, test::random_pose(&rng, 1.0));
    std::vector<const CloudSnapshot*> clouds;
    if (has_cloud) clouds = {&cloud};
    std::vector<ImpactTime> found;
    const std::vector<bool> wanted(arm.size(), true);
    impacts.run(motion.joints, motion.still, motion.X_FR, wanted, clouds, {&world}, &found);
    for (const ImpactTime& one : found) EXPECT_TRUE(std::isnan(one.time)) << "no surfaces are set";
    impacts.set_surfaces(make_robot_surfaces(arm.model), {});
    impacts.run(motion.joints, motion.still, motion.X_FR, wanted, clouds, {&world}, &found);
    const auto of_balls = [&](double time) {
      return test::sampled_distance(arm, balls, time) - kRadius - kMargin;
    };
    const auto distance = [&](double time) {
      const double ball = of_balls(time);
      return has_cloud ? std::min(ball, test::sampled_distance(arm, motion, time)) : ball;
    };
    SCOPED_TRACE("motion " + std::to_string(i));
    const double contact = counts.expect(found, distance, motion.joints.duration);
    by_ball += contact < kInf && of_balls(contact) < 3e-6 ? 1 : 0;
    if (HasFailure()) return;
  }
  if (test::kSanitized) return;  // too few motions to count
  EXPECT_GT(counts.contacts, 10);
  EXPECT_GT(by_ball, counts.contacts / 4);
  EXPECT_GT(counts.free, 0);
}

// Two balls that one link carries, and which the others may run into.
struct CarriedBalls {
  std::size_t link;                  // of the model: it may touch them
  std::vector<Eigen::Vector3d> p_B;  // [m] their centres, in that link's frame
};

// Where another link is at some time of the motion, so that they meet now and then.
CarriedBalls random_carried_balls(test::Rng* rng, const test::Arm& arm,
                                  const test::ArmMotion& motion) {
  CarriedBalls balls;
  balls.link = test::random_link(rng, arm);
  for (int i = 0; i < 2; ++i) {
    const double time = test::uniform(rng, 0.3, 1.2) * motion.joints.duration;
    const std::vector<Eigen::Isometry3d> X_FB = test::sampled_poses(arm, motion, time);
    const Eigen::Vector3d p_F =
        X_FB[arm.bodies[test::random_link(rng, arm)]] * test::random_vector(rng, 0.1);
    balls.p_B.push_back(X_FB[arm.bodies[balls.link]].inverse() * p_F);
  }
  return balls;
}

// [m] The exact distance of the centres of balls from all links but the one that carries them.
double distance_to_carried(const test::Arm& arm, const test::ArmMotion& motion,
                           const CarriedBalls& balls, double time) {
  const std::vector<Eigen::Isometry3d> X_FB = test::sampled_poses(arm, motion, time);
  std::vector<Eigen::Vector3d> centers;
  for (const Eigen::Vector3d& p_B : balls.p_B) {
    centers.push_back(X_FB[arm.bodies[balls.link]] * p_B);
  }
  double smallest = kInf;
  for (std::size_t i = 0; i < arm.size(); ++i) {
    if (i == balls.link) continue;
    const double d = test::oracle_minimum(arm.links[i], X_FB[arm.bodies[i]], centers);
    smallest = std::min(smallest, d);
  }
  return smallest;
}

bool may_move(const Kinematics& kinematics, std::size_t body) {
  for (; body > 0; body = kinematics.joints()[body - 1].parent) {
    if (kinematics.joints()[body - 1].type != JointType::kFixed) return true;
  }
  return false;
}

// What the robot carries moves with it: no link touches it before the time that is returned, and
// one touches it then.
TEST(TimeOfImpact, CarriedObjectsMoveWithTheirBodies) {
  constexpr double kRadius = 0.005;
  test::Rng rng(69);
  Contacts counts;
  for (int i = 0; i < test::scaled(300); ++i) {
    const test::Arm arm = test::random_arm(&rng);
    const test::ArmMotion motion = test::random_motion(&rng, arm);
    const CarriedBalls balls = random_carried_balls(&rng, arm, motion);
    const std::size_t body = arm.bodies[balls.link];
    std::vector<WorldObject> objects;
    for (const Eigen::Vector3d& p_B : balls.p_B) {
      const std::string name = "ball " + std::to_string(objects.size());
      const Eigen::Isometry3d X_BO(Eigen::Translation3d{p_B});
      objects.push_back(test::object_of(name, test::one(Sphere{kRadius}), X_BO));
      objects.back().frame = arm.kinematics->bodies()[body];
      objects.back().allowed_links = {objects.back().frame};
    }
    // Where the robot is now does not matter, but for bodies that cannot move.
    const PosedWorld world = test::posed(
        objects, may_move(*arm.kinematics, body) ? test::random_pose(&rng, 1.0)
                                                 : test::sampled_poses(arm, motion, 0.0)[body]);
    const std::vector<ImpactTime> found = impacts_with(world, arm, motion);
    SCOPED_TRACE("motion " + std::to_string(i));
    const auto distance = [&](double time) {
      return distance_to_carried(arm, motion, balls, time) - kRadius;
    };
    counts.expect(found, distance, motion.joints.duration);
    if (HasFailure()) return;
  }
  EXPECT_GT(counts.contacts, test::scaled(300) / 15);
  EXPECT_GT(counts.free, test::scaled(300) / 15);
}

// A ball in the frame of a body whose pose is not known may be anywhere.
TEST(TimeOfImpact, CarriedByABodyThatIsNotKnown) {
  test::Rng rng(70);
  int unknown = 0;
  for (int i = 0; i < 50; ++i) {
    const test::Arm arm = test::random_arm(&rng);
    test::ArmMotion motion = test::random_motion(&rng, arm);
    const std::size_t body = arm.bodies.back();
    const std::size_t joint = body - 1;
    if (arm.kinematics->joints()[joint].type == JointType::kFixed) continue;
    WorldObject object = test::object_of("carried", test::one(Sphere{0.1}));
    object.frame = arm.kinematics->bodies()[body];
    const PosedWorld world = test::posed({object});
    const std::size_t source = arm.kinematics->joints()[joint].source;
    for (const std::size_t unstated : {joint, source}) {
      motion.joints.from[unstated] = motion.joints.to[unstated] = std::nan("");
    }
    motion.still.known[body - 1] = false;
    for (const ImpactTime& one : impacts_with(world, arm, motion)) {
      EXPECT_TRUE(std::isnan(one.time)) << "arm " << i;
    }
    ++unknown;
  }
  EXPECT_GT(unknown, 20);
}

// The largest displacement [m] of a point of a sphere on a body between two instants.
double displacement(const test::Arm& arm, const test::ArmMotion& motion, std::size_t body,
                    const Eigen::Vector3d& center, double radius, double from, double to) {
  const Eigen::Isometry3d X_FA = test::sampled_poses(arm, motion, from)[body];
  const Eigen::Isometry3d X_FB = test::sampled_poses(arm, motion, to)[body];
  double largest = 0.0;
  for (int k = 0; k < 26; ++k) {
    const Eigen::Vector3d n(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1);
    const Eigen::Vector3d p = center + radius * n.normalized();
    largest = std::max(largest, (X_FA * p - X_FB * p).norm());
  }
  return largest;
}

// During the time that the motion bound allows, no point moves farther than the distance.
TEST(MotionBound, noPointMovesFarther) {
  test::Rng rng(68);
  double closest = 0.0;  // share of the distance that was used
  for (int i = 0; i < test::scaled(2000); ++i) {
    const test::Arm arm = test::random_arm(&rng);
    const test::ArmMotion motion = test::random_motion(&rng, arm);
    const std::size_t body = arm.bodies[test::random_link(&rng, arm)];
    const double start = test::uniform(&rng, 0.0, 0.5) * motion.joints.duration;
    const std::vector<Eigen::Isometry3d> X_FB = test::sampled_poses(arm, motion, start);
    // Every other time the sphere is about a place that an early joint does not move.
    Eigen::Vector3d center = test::random_vector(&rng, 0.1);
    if (i % 2 == 0) center = X_FB[body].inverse() * X_FB[arm.bodies[0]].translation();
    const double radius = i % 3 == 0 ? 0.0 : 0.1;
    JointMotion placed = motion.joints;
    arm.kinematics->place_mimics(&placed.from);
    arm.kinematics->place_mimics(&placed.to);
    const MotionBound bound(*arm.kinematics, placed, body, center, radius);
    const double distance = test::uniform(&rng, 0.01, 1.0);
    const double time =
        std::min(time_within(distance, bound.speed(X_FB)), motion.joints.duration - start);
    for (const double share : {0.25, 0.5, 0.75, 1.0}) {
      const double moved =
          displacement(arm, motion, body, center, radius, start, start + share * time);
      ASSERT_LE(moved, distance * (1.0 + 1e-6)) << "case " << i << ", " << share * time << " s";
      closest = std::max(closest, moved / distance);
    }
  }
  EXPECT_GT(closest, 0.9);
}

// Arguments that do not fit the model, as a request can bring about, give no time at all.
TEST(TimeOfImpact, unknownWhereArgumentsDoNotFit) {
  test::Rng rng(67);
  const test::Arm arm = test::random_arm(&rng);
  TimeOfImpact impacts(arm.model, arm.kinematics, QueryConfig());
  const test::ArmMotion motion = test::random_motion(&rng, arm);
  const CloudSnapshot cloud = test::make_snapshot(motion.points);
  const auto all_unknown = [&](const JointMotion& joints, const JointPoses& still,
                               std::size_t wanted) {
    std::vector<ImpactTime> found(1);
    found[0].time = kInf;
    impacts.run(joints, still, motion.X_FR, std::vector<bool>(wanted, true), {&cloud}, &found);
    return found.size() == arm.size() &&
           std::all_of(found.begin(), found.end(),
                       [](const ImpactTime& one) { return std::isnan(one.time); });
  };
  EXPECT_FALSE(all_unknown(motion.joints, motion.still, arm.size()));
  EXPECT_TRUE(all_unknown(motion.joints, JointPoses(), arm.size()));
  EXPECT_TRUE(all_unknown(motion.joints, motion.still, arm.size() + 1));
  for (const double duration : {0.0, -1.0, std::nan(""), kInf}) {
    JointMotion joints = motion.joints;
    joints.duration = duration;
    EXPECT_TRUE(all_unknown(joints, motion.still, arm.size())) << duration;
  }
  JointMotion joints = motion.joints;
  joints.to.push_back(0.0);
  EXPECT_TRUE(all_unknown(joints, motion.still, arm.size()));
}

// A sphere on a turning arm of 1 m touches a point when its centre is 0.1 m from it.
TEST(TimeOfImpact, handComputed) {
  RobotDescription robot;
  robot.root_link = "base";
  robot.joints = {test::joint("turn", JointType::kRevolute, "base", "arm", {0, 0, 0}, {0, 0, 1}),
                  test::joint("tip", JointType::kFixed, "arm", "sphere", {1, 0, 0})};
  const auto model = test::make_model({Sphere{0.1}}, 0.005);
  model->links[0].name = "sphere";
  const auto kinematics = std::make_shared<const Kinematics>(robot);
  JointPoses still;
  kinematics->place_joints({0.0, 0.0}, &still);
  const CloudSnapshot cloud = test::make_snapshot({{0, 1, 0}});
  const double angle = EIGEN_PI / 2.0 - 2.0 * std::asin(0.05);  // chord of 0.1
  JointMotion motion{{0.0, 0.0}, {2.0, 0.0}, 4.0};              // 0.5 rad/s
  std::vector<ImpactTime> impact;
  TimeOfImpact impacts(model, kinematics, QueryConfig());
  const auto run = [&](SnapshotSpan clouds) {
    impacts.run(motion, still, Eigen::Isometry3d::Identity(), {true}, clouds, &impact);
    return impact[0].time;
  };
  const double time = run({&cloud});
  EXPECT_LE(time, angle / 0.5);
  EXPECT_GT(time, angle / 0.5 - 1e-4);
  EXPECT_TRUE(impact[0].converged);
  EXPECT_LT(impact[0].steps, 100);

  // A margin makes the time earlier.
  QueryConfig config;
  config.margin = 0.02;
  impacts = TimeOfImpact(model, kinematics, config);
  EXPECT_NEAR(run({&cloud}), (EIGEN_PI / 2.0 - 2.0 * std::asin(0.06)) / 0.5, 1e-4);
  impacts = TimeOfImpact(model, kinematics, QueryConfig());

  motion.to[0] = 0.5 * angle;  // stops before
  EXPECT_EQ(run({&cloud}), kInf);
  motion.to[0] = -1.0;  // goes away
  EXPECT_EQ(run({&cloud}), kInf);
  EXPECT_TRUE(std::isnan(run({}))) << "no cloud";
  const CloudSnapshot touching = test::make_snapshot({{1.05, 0, 0}});
  EXPECT_EQ(run({&touching}), 0.0);
  // Nothing moves, so there is no contact.
  motion.to = motion.from;
  EXPECT_EQ(run({&cloud}), kInf);
  motion.from = motion.to = {std::nan(""), std::nan("")};
  EXPECT_EQ(run({&cloud}), kInf);
  still.known[0] = false;
  EXPECT_TRUE(std::isnan(run({&cloud}))) << "the joint's position is not known";
}

}  // namespace
}  // namespace ist
