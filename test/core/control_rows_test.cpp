// Rows against exact distances: gradients, certified radii, and the theorem of ConstraintRows.

#include "ist_proximity/control/constraint_rows.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <set>
#include <string>
#include <vector>

#include "ist_proximity/control/velocity_filter.h"
#include "support/control_robots.h"
#include "support/data_dir.h"
#include "support/random_numbers.h"
#include "support/sanitizers.h"
#include "support/truth.h"

namespace ist {
namespace {

using test::ControlRobot;

test::ControlRobot panda(const std::filesystem::path& data) {
  const RobotDescription description = test::read_panda(data, GeometrySource::kCollision);
  RobotModelConfig config;
  config.packing.max_error = 0.02;
  return {"panda", build_robot_model(description, config), description};
}

std::vector<ControlRobot> robots() {
  std::vector<ControlRobot> robots;
  robots.push_back(test::demo_control_robot());
  robots.push_back(test::mesh_control_robot());
  const auto data = test::data_dir();
  if (data && !test::kSanitized) robots.push_back(panda(*data));
  return robots;
}

QueryConfig exact() {
  QueryConfig config;
  config.tolerance = 0.0;
  config.max_distance = 0.5;
  return config;
}

// A robot among points, with the rows at a configuration.
class Scene {
 public:
  Scene(ControlRobot* robot, test::Rng* rng, int count, double farthest)
      : robot_(robot),
        query_(robot->model, exact()),
        builder_(*robot->model, robot->kinematics),
        q(robot->random_position(rng)) {
    robot->place(q);
    for (int i = 0; i < count; ++i) {
      // Points as floats, as clouds hold them.
      points.push_back(
          robot->point_near(rng, test::uniform(rng, 0.005, farthest)).cast<float>().cast<double>());
    }
    cloud_ = test::make_snapshot(points);
  }

  const std::vector<LinkProximity>& measure(const Eigen::VectorXd& at) {
    robot_->place(at);
    query_.run(robot_->poses().X_FL, robot_->poses().known, {&cloud_}, &answers_);
    return answers_;
  }
  const ConstraintRows& rows(const RowConfig& config) {
    measure(q);
    builder_.begin(robot_->forward.bodies(), config);
    builder_.add_links(answers_);
    return builder_.rows();
  }

 private:
  ControlRobot* robot_;
  ProximityQuery query_;
  ConstraintRowBuilder builder_;
  CloudSnapshot cloud_;
  std::vector<LinkProximity> answers_;

 public:
  const Eigen::VectorXd q;
  std::vector<Eigen::Vector3d> points;
};

Eigen::VectorXd random_step(test::Rng* rng, Eigen::Index joints, double length) {
  Eigen::VectorXd step(joints);
  for (Eigen::Index k = 0; k < joints; ++k) step[k] = test::uniform(rng, -1.0, 1.0);
  return length / step.norm() * step;
}

constexpr double kStep = 1e-5;  // [rad] of a difference

// Changes of distances over twice a step beside those that rows tell, where the nearest places stay
// what they are.
struct Gradients {
  int compared = 0, changed = 0;

  void compare(double change, const ConstraintRows& rows, Eigen::Index row,
               const Eigen::VectorXd& step, bool is_same, double rounding) {
    const double scale = 2.0 * rows.G.row(row).norm() * kStep;
    if (!is_same || scale < 1e-2 * kStep) {
      ++changed;
      return;
    }
    ++compared;
    ASSERT_NEAR(change, -2.0 * rows.G.row(row).dot(step), 1e-3 * scale + rounding);
  }
};

TEST(ConstraintRows, GradientsAgreeWithCentralDifferences) {
  test::Rng rng(471);
  for (ControlRobot& robot : robots()) {
    Gradients gradients;
    SCOPED_TRACE(robot.name);
    for (int trial = 0; trial < test::scaled(3400); ++trial) {
      Scene scene(&robot, &rng, 3, 0.2);
      const ConstraintRows rows = scene.rows({});
      ASSERT_TRUE(rows.is_complete);
      const std::vector<LinkProximity> now = scene.measure(scene.q);
      const Eigen::VectorXd step = random_step(&rng, scene.q.size(), kStep);
      const std::vector<LinkProximity> after = scene.measure(scene.q + step);
      const std::vector<LinkProximity> before = scene.measure(scene.q - step);
      for (std::size_t i = 0; i < rows.count; ++i) {
        const auto row = static_cast<Eigen::Index>(i);
        const auto link = static_cast<std::size_t>(rows.origins[i].index);
        if (now[link].state != LinkState::kNear) continue;
        const double moved = (after[link].p_LCl - before[link].p_LCl).norm();
        const double kink = (after[link].direction - before[link].direction).norm();
        const bool is_same = after[link].point == before[link].point &&
                             after[link].state == before[link].state && moved < 20.0 * kStep &&
                             kink < 20.0 * kStep;
        const double change = after[link].distance - before[link].distance;
        gradients.compare(change, rows, row, step, is_same, 0.0);
        ASSERT_FALSE(HasFatalFailure()) << trial << ", " << robot.model->links[link].name;
      }
    }
    EXPECT_GT(gradients.compared, 3 * gradients.changed);
  }
}

// The distance of the nearest point from the plane through the witness, fixed to the link.
TEST(ConstraintRows, CertifiedRadiusHolds) {
  test::Rng rng(472);
  const RowConfig config;
  const std::set<std::string> convex = {"l1", "l3", "l6"};
  for (ControlRobot& robot : robots()) {
    int steps = 0;
    double widest = 0.0;
    while (steps < test::scaled(34000)) {
      Scene scene(&robot, &rng, 2, 0.3);
      const ConstraintRows rows = scene.rows(config);
      const std::vector<LinkProximity> now = scene.measure(scene.q);
      const std::vector<Eigen::Isometry3d> X_FL = robot.poses().X_FL;
      for (std::size_t i = 0; i < rows.count; ++i) {
        const auto row = static_cast<Eigen::Index>(i);
        const auto link = static_cast<std::size_t>(rows.origins[i].index);
        const LinkProximity& answer = now[link];
        if (answer.state < LinkState::kNear) continue;
        const Eigen::Vector3d n_L = X_FL[link].linear().transpose() * answer.direction;
        const bool is_convex =
            robot.name == "meshes" && convex.count(robot.model->links[link].name);
        for (int k = 0; k < 20; ++k, ++steps) {
          const Eigen::VectorXd step = random_step(
              &rng, scene.q.size(), rows.radius[row] * std::sqrt(test::uniform(&rng, 0.0, 1.0)));
          robot.place(scene.q + step);
          const Eigen::Vector3d p_LCo = robot.poses().X_FL[link].inverse() * answer.p_FCo;
          const double plane = n_L.dot(answer.p_LCl - p_LCo);
          const double linear = answer.distance - rows.G.row(row).dot(step);
          ASSERT_LE(std::abs(plane - linear), config.linear_error) << robot.name;
          widest = std::max(widest, std::abs(plane - linear));
          if (is_convex) ASSERT_GE(robot.exact_distance(link, {answer.p_FCo}), plane - 1e-9);
        }
      }
    }
    // The bound is no wild one.
    EXPECT_GT(widest, 0.1 * config.linear_error) << robot.name;
  }
}

// Half of them with obstacles that come, and a skin in which some may be hidden.
RowConfig random_config(test::Rng* rng) {
  RowConfig config;
  config.horizon = test::power_of_ten(rng, -3.0, 0.0);
  config.approach_time = 1.0;
  const bool hides = test::chance(rng, 0.5);
  config.blind_skin = hides ? test::uniform(rng, 0.0, 0.03) : 0.0;
  config.age = test::uniform(rng, 0.0, 0.2);
  config.obstacle_speed = hides ? test::uniform(rng, 0.0, 0.1) : 0.0;
  return config;
}

// As fast as a row's sweep allows; not finite where nothing is swept.
Eigen::VectorXd fastest(const ConstraintRows& rows, Eigen::Index row, const Eigen::VectorXd& way) {
  return rows.sweep_limit[row] / rows.sweep.row(row).dot(way.cwiseAbs()) * way;
}

// [m] What the theorem leaves of a bound.
double left_of(double bound, double margin) { return bound > margin ? margin : 0.5 * bound; }

// Any velocity that a row's sweep allows leaves what the theorem says to every point, after any
// part of the horizon; and it is not far from what is possible.
TEST(ConstraintRows, SweepLeavesTheMargin) {
  test::Rng rng(473);
  for (ControlRobot& robot : robots()) {
    double closest = 1.0;
    for (int trial = 0; trial < test::scaled(1500); ++trial) {
      const RowConfig config = random_config(&rng);
      const double come = config.obstacle_speed * (config.age + config.horizon);
      Scene scene(&robot, &rng, 8, 0.2);
      const ConstraintRows rows = scene.rows(config);
      for (std::size_t i = 0; i < rows.count; ++i) {
        const auto row = static_cast<Eigen::Index>(i);
        const auto link = static_cast<std::size_t>(rows.origins[i].index);
        const double bound = rows.origins[i].bound - come;
        if (!(bound > config.blind_skin)) continue;
        const double left = left_of(bound, config.margin + config.blind_skin);
        Eigen::VectorXd way = random_step(&rng, scene.q.size(), 1.0);
        // Half of them approach the witness.
        if (trial % 2 == 0) way = rows.G.row(row).transpose();
        const Eigen::VectorXd velocity = fastest(rows, row, way);
        if (!velocity.allFinite()) continue;
        for (const double part : {1.0, test::uniform(&rng, 0.0, 1.0)}) {
          robot.place(scene.q + part * config.horizon * velocity);
          const double distance = robot.exact_distance(link, scene.points) - come;
          ASSERT_GE(distance, left - 1e-9) << robot.name << " " << trial;
          closest = std::min(closest, (distance - left) / (bound - left));
        }
      }
    }
    EXPECT_LT(closest, 0.3) << robot.name;
  }
}

TEST(ConstraintRows, PairsAreBoundedLikeObstacles) {
  test::Rng rng(474);
  for (ControlRobot& robot : robots()) {
    const std::vector<bool> all(robot.model->links.size(), true);
    const std::vector<LinkPair> pairs =
        self_collision_pairs(*robot.model, *robot.kinematics, all, {});
    SelfQuery query(robot.model, pairs, exact());
    ConstraintRowBuilder builder(*robot.model, robot.kinematics, pairs);
    Gradients gradients;
    std::vector<PairProximity> now, after, before;
    const auto measure = [&](const Eigen::VectorXd& q, std::vector<PairProximity>* answers) {
      robot.place(q);
      query.run(robot.poses().X_FL, robot.poses().known, answers);
    };
    SCOPED_TRACE(robot.name);
    for (int trial = 0; trial < test::scaled(robot.name == "panda" ? 60 : 300); ++trial) {
      const Eigen::VectorXd q = robot.random_position(&rng);
      measure(q, &now);
      RowConfig config;
      builder.begin(robot.forward.bodies(), config);
      builder.add_pairs(now);
      const ConstraintRows& rows = builder.rows();
      ASSERT_TRUE(rows.is_complete);
      const Eigen::VectorXd step = random_step(&rng, q.size(), kStep);
      measure(q + step, &after);
      measure(q - step, &before);
      for (std::size_t i = 0; i < rows.count; ++i) {
        const auto row = static_cast<Eigen::Index>(i);
        const auto pair = static_cast<std::size_t>(rows.origins[i].index);
        ASSERT_TRUE(rows.origins[i].is_pair);
        if (now[pair].state != LinkState::kNear || now[pair].distance < 0.01) continue;
        const bool is_same = (after[pair].p_FCa - before[pair].p_FCa).norm() < 4e-4 &&
                             (after[pair].direction - before[pair].direction).norm() < 4e-4;
        const double change = after[pair].distance - before[pair].distance;
        gradients.compare(change, rows, row, step, is_same, 1e-10);
        ASSERT_FALSE(HasFatalFailure()) << trial;
      }
      const auto row = static_cast<Eigen::Index>(test::below(&rng, rows.count));
      const auto pair = static_cast<std::size_t>(rows.origins[static_cast<std::size_t>(row)].index);
      const double bound = now[pair].lower_bound;
      if (!(bound > config.margin)) continue;
      const Eigen::VectorXd velocity = fastest(rows, row, random_step(&rng, q.size(), 1.0));
      if (!velocity.allFinite()) continue;
      measure(q + config.horizon * velocity, &after);
      if (after[pair].state == LinkState::kClear) continue;
      ASSERT_GE(after[pair].distance, config.margin - 1e-9) << trial;
    }
    EXPECT_GT(gradients.compared, gradients.changed);
  }
}

// The answers that a row has to be careful with, for one link.
class RowsOfAnswers : public ::testing::Test {
 protected:
  RowsOfAnswers() { robot_.place(Eigen::VectorXd::Constant(columns(), 0.3)); }
  Eigen::Index columns() const { return static_cast<Eigen::Index>(robot_.joints.size()); }

  LinkProximity near(double bound) const {
    LinkProximity answer;
    answer.state = bound < 0.0 ? LinkState::kContact : LinkState::kNear;
    answer.distance = answer.lower_bound = bound;
    answer.direction = Eigen::Vector3d::UnitX();
    answer.p_FCl = robot_.poses().X_FL.back().translation();
    answer.p_FCo = answer.p_FCl - bound * answer.direction;
    return answer;
  }
  // The only row of the last link.
  const ConstraintRows& row(const LinkProximity& answer, const RowConfig& config = {},
                            double speed = 0.0) {
    builder_.begin(robot_.forward.bodies(), config);
    builder_.add_link(robot_.model->links.size() - 1, answer, speed);
    EXPECT_TRUE(builder_.rows().is_complete);
    EXPECT_EQ(builder_.rows().count, 1U);
    return builder_.rows();
  }

  ControlRobot robot_ = test::mesh_control_robot();
  ConstraintRowBuilder builder_{*robot_.model, robot_.kinematics};
};

TEST_F(RowsOfAnswers, AllowNoMotionOfWhatIsNotKnown) {
  const ConstraintRows& rows = row(LinkProximity());
  EXPECT_EQ(rows.sweep_limit[0], 0.0);
  EXPECT_TRUE((rows.sweep.row(0).array() > 0.0).all());
  EXPECT_TRUE(rows.G.row(0).isZero(0.0));
  EXPECT_EQ(rows.origins[0].state, LinkState::kUnknown);
  LinkProximity lost = near(-0.01);
  lost.direction.setConstant(std::nan(""));
  EXPECT_EQ(row(lost).sweep_limit[0], 0.0);
  // Nothing is known about what is within the blind skin, and there is no way out.
  RowConfig config;
  config.blind_skin = 0.15;
  LinkProximity clear = near(0.1);
  clear.state = LinkState::kClear;
  EXPECT_EQ(row(clear, config).sweep_limit[0], 0.0);
}

TEST_F(RowsOfAnswers, LeaveTheWayOutOfContactAndOfTheStopDistance) {
  RowConfig config;
  EXPECT_EQ(row(near(0.03), config).h[0], 0.0);
  EXPECT_GT(row(near(0.03), config).sweep_limit[0], 0.0);
  EXPECT_TRUE(row(near(0.03), config).origins[0].is_proven);
  EXPECT_EQ(row(near(-0.01), config).h[0], 0.0);
  EXPECT_FALSE(row(near(-0.01), config).origins[0].is_proven);
  EXPECT_NEAR(row(near(0.005), config).sweep_limit[0], config.escape_speed, 1e-12);
  EXPECT_NEAR(row(near(-0.01), config).sweep_limit[0], config.escape_speed / 5.0, 1e-12);
  config.retreat_speed = 0.1;
  EXPECT_EQ(row(near(0.03), config).h[0], -0.1);
  EXPECT_NEAR(row(near(0.15), config).h[0], 0.1 / config.approach_time, 1e-8);
  RowConfig fast = config;
  fast.escape_speed = 5.0;
  EXPECT_NEAR(row(near(-0.01), fast).h[0], -0.1 / 5.0, 1e-12);
  // What may be nearer than the answer says is as contact.
  config.blind_skin = 0.03;
  EXPECT_FALSE(row(near(0.02), config).origins[0].is_proven);
  EXPECT_NEAR(row(near(0.02), config).sweep_limit[0], config.escape_speed / 5.0, 1e-12);
  EXPECT_TRUE(row(near(0.035), config).origins[0].is_proven);
  EXPECT_NEAR(row(near(0.035), config).sweep_limit[0], config.escape_speed, 1e-12);
}

TEST_F(RowsOfAnswers, AskForNoRetreatThatTheyForbid) {
  RowConfig config;
  config.retreat_speed = 1.0;
  VelocityFilter filter(joint_limits(*robot_.kinematics, 2.0));
  const std::vector<double> zero(robot_.joints.size(), 0.0);
  for (const double bound : {-0.01, 0.0001, 0.005, 0.0101, 0.03}) {
    const ConstraintRows& rows = row(near(bound), config);
    const FilterAnswer& answer = filter.run(zero, zero, rows);
    EXPECT_EQ(answer.reason, FilterReason::kNone) << bound;
    const Eigen::Map<const Eigen::VectorXd> velocity(answer.velocity.data(), columns());
    EXPECT_LT(rows.G.row(0).dot(velocity), 0.0) << bound;
  }
  config.escape_speed = 0.0;
  EXPECT_EQ(row(near(-0.01), config).h[0], 0.0);
}

TEST_F(RowsOfAnswers, CountTheObstaclesSpeedAndAge) {
  RowConfig config;
  config.age = 0.03;
  const double left = 0.25 - 0.5 * (config.age + config.horizon) - config.margin;
  EXPECT_NEAR(row(near(0.25), config, 0.5).sweep_limit[0], left / config.horizon, 1e-6);
  EXPECT_NEAR(row(near(0.25), config, 0.5).h[0],
              (0.25 - 0.015 - config.stop_distance) / config.approach_time - 0.5, 1e-8);
  const double unstated = row(near(0.25), config).h[0];
  EXPECT_EQ(row(near(0.25), config, std::nan("")).h[0], unstated);
  EXPECT_LT(row(near(0.25), config, 0.1).h[0], unstated);
}

TEST_F(RowsOfAnswers, ApproachNothingInContactWhateverIsRounded) {
  test::Rng rng(475);
  RowConfig config;
  config.margin = config.stop_distance = 0.0;
  for (int trial = 0; trial < test::scaled(2000); ++trial) {
    config.horizon = config.approach_time = test::power_of_ten(&rng, -3.0, 0.0);
    config.obstacle_speed = test::power_of_ten(&rng, -3.0, 3.0);
    config.age = test::power_of_ten(&rng, -3.0, 0.0);
    config.blind_skin = test::uniform(&rng, 0.0, 0.1);
    const double bound = config.obstacle_speed * (config.age + config.horizon) + config.blind_skin;
    const ConstraintRows& rows = row(near(bound), config);
    if (!rows.origins[0].is_proven) ASSERT_LE(rows.h[0], 0.0) << trial;
  }
  // A speed without bound is a number in no row.
  config.age = 0.0;
  EXPECT_EQ(row(near(0.3), config, std::numeric_limits<double>::infinity()).h[0], 0.0);
}

TEST_F(RowsOfAnswers, AreBoundedInAnotherWayFromThereOn) {
  RowConfig config, other;
  other.stop_distance = other.margin = 0.0;
  EXPECT_EQ(row(near(0.03), config).h[0], 0.0);
  builder_.set_config(other);
  builder_.add_link(robot_.model->links.size() - 1, near(0.03));
  const ConstraintRows& rows = builder_.rows();
  ASSERT_TRUE(rows.is_complete);
  EXPECT_EQ(rows.h[0], 0.0);
  EXPECT_NEAR(rows.h[1], 0.03 / other.approach_time, 1e-8);
  EXPECT_NEAR(rows.sweep_limit[1], 0.03 / config.horizon, 1e-6);
  other.horizon *= 2.0;
  builder_.set_config(other);
  EXPECT_FALSE(rows.is_complete);
}

TEST_F(RowsOfAnswers, AreIncompleteWhereSizesOrSettingsAreWrong) {
  const auto is_complete = [&](const RowConfig& config, std::size_t answers) {
    builder_.begin(robot_.forward.bodies(), config);
    builder_.add_links(std::vector<LinkProximity>(answers));
    return builder_.rows().is_complete;
  };
  const std::size_t links = robot_.model->links.size();
  RowConfig config;
  EXPECT_TRUE(is_complete(config, links));
  EXPECT_FALSE(is_complete(config, links + 1));
  config.horizon = 0.0;
  EXPECT_FALSE(is_complete(config, links));
  EXPECT_EQ(config_errors(config).size(), 1U);
  config = RowConfig();
  config.margin = 1.0;
  EXPECT_FALSE(is_complete(config, links));
  EXPECT_NE(config_errors(config, "~filter/").at(0).find("~filter/stop_distance"),
            std::string::npos);
  const std::vector<LinkProximity> answers(links);
  EXPECT_FALSE(constraint_rows(*robot_.model, robot_.kinematics, {0.0, 0.0}, answers).is_complete);
}

}  // namespace
}  // namespace ist
