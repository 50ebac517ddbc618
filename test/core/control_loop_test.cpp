// A filter in a loop, in 200 scenes: the arm does not drive into what it is told of, and leaves
// when it starts too near. Distances are checked exactly.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "ist_proximity/control/velocity_filter.h"
#include "support/control_robots.h"
#include "support/random_numbers.h"
#include "support/sanitizers.h"

namespace ist {
namespace {

using test::ControlRobot;
using Points = std::vector<Eigen::Vector3d>;

Span<const double> span(const Eigen::VectorXd& v) {
  return {v.data(), static_cast<std::size_t>(v.size())};
}

QueryConfig exact() {
  QueryConfig config;
  config.tolerance = 0.0;
  return config;
}

// One cycle after another: distances, rows, the filter, and the motion.
class Loop {
 public:
  Loop(ControlRobot* robot, const RowConfig& row_config)
      : config(row_config),
        robot_(robot),
        query_(robot->model, exact()),
        builder_(*robot->model, robot->kinematics),
        filter_(joint_limits(*robot->kinematics, 2.0)) {}

  // Adds to the rows of a cycle, after begin().
  void begin(const Eigen::VectorXd& q) {
    robot_->place(q);
    builder_.begin(robot_->forward.bodies(), config);
  }
  void add(const CloudSnapshot& cloud, double speed) {
    query_.run(robot_->poses().X_FL, robot_->poses().known, {&cloud}, &answers_);
    builder_.add_links(answers_, std::vector<double>(answers_.size(), speed));
  }
  Eigen::VectorXd filtered(const Eigen::VectorXd& command, const Eigen::VectorXd& q) {
    answer = &filter_.run(span(command), span(q), builder_.rows());
    return Eigen::Map<const Eigen::VectorXd>(answer->velocity.data(), command.size());
  }
  const ConstraintRows& rows() const { return builder_.rows(); }

  RowConfig config;
  const FilterAnswer* answer = nullptr;

 private:
  ControlRobot* robot_;
  ProximityQuery query_;
  ConstraintRowBuilder builder_;
  VelocityFilter filter_;
  std::vector<LinkProximity> answers_;
};

// A ball of points that goes to and fro, and turns when it is about to touch.
struct Ball {
  Eigen::Vector3d center, velocity;
  Points points() const {
    Points points;
    for (int k = 0; k < 26; ++k) {
      const double z = -1.0 + (2.0 * k + 1.0) / 26.0, r = std::sqrt(1.0 - z * z), a = 2.4 * k;
      points.push_back(center + 0.08 * Eigen::Vector3d(r * std::cos(a), r * std::sin(a), z));
    }
    return points;
  }
};

TEST(ControlLoop, NeverDrivesIntoObstacles) {
  ControlRobot robot = test::demo_control_robot();
  test::Rng rng(481);
  int moved = 0, held = 0;
  for (int scene = 0; scene < test::scaled(200); ++scene) {
    Eigen::VectorXd q = robot.random_position(&rng);
    const Eigen::VectorXd start = q;
    const Eigen::VectorXd goal = robot.random_position(&rng);
    // Clutter about the whole way, apart from where the arm starts.
    Points clutter;
    while (clutter.size() < 30) {
      robot.place(start + test::uniform(&rng, 0.0, 1.0) * (goal - start));
      const Eigen::Vector3d p = robot.point_near(&rng, test::uniform(&rng, -0.02, 0.2));
      robot.place(start);
      if (robot.exact_distance({p}) > 0.06) clutter.push_back(p.cast<float>().cast<double>());
    }
    const CloudSnapshot cloud = test::make_snapshot(clutter);
    Ball ball;
    do {
      ball.center = robot.point_near(&rng, 0.5);
    } while (robot.exact_distance(ball.points()) < 0.3);
    ball.velocity = test::uniform(&rng, 0.05, 0.3) * test::random_vector(&rng, 1.0).normalized();
    Loop loop(&robot, RowConfig());
    const double horizon = loop.config.horizon;
    // A bound that rounding puts below the margin lets a link move once.
    const double least = loop.config.margin - loop.config.escape_speed * horizon - 1e-6;
    for (int cycle = 0; cycle < 60; ++cycle) {
      const Points now = ball.points();
      loop.begin(q);
      loop.add(cloud, 0.0);
      loop.add(test::make_snapshot(now), ball.velocity.norm());
      ASSERT_TRUE(loop.rows().is_complete);
      const double before = robot.exact_distance(now);
      Eigen::VectorXd command = 3.0 * (goal - q);
      const Eigen::VectorXd velocity = loop.filtered(command, q);
      ASSERT_EQ(loop.answer->reason, FilterReason::kNone);
      held += loop.answer->rows.empty() ? 0 : 1;
      q += horizon * velocity;
      ball.center += horizon * ball.velocity;
      robot.place(q);
      ASSERT_GE(robot.exact_distance(clutter), least) << scene << ", " << cycle;
      // By at most the ball's own motion and half of what was left.
      const double left = before - horizon * ball.velocity.norm();
      const double after = robot.exact_distance(ball.points());
      ASSERT_GE(after, std::min(loop.config.margin, 0.5 * left) - 1e-6) << scene << ", " << cycle;
      ASSERT_GT(after, 0.0) << scene << ", " << cycle;
      if (after < 0.06 || cycle % 30 == 29) ball.velocity *= -1.0;
    }
    moved += (q - start).norm() > 0.3 ? 1 : 0;
  }
  // It is held back, and goes on where it may.
  EXPECT_GT(moved, test::scaled(100));
  EXPECT_GT(held, test::scaled(2000));
}

// How fast joints move the only place within a distance; 0 where there is none, or several.
double speed_of_only(const ConstraintRows& rows, double distance) {
  int near = 0;
  double speed = 0.0;
  for (std::size_t i = 0; i < rows.count; ++i) {
    if (rows.origins[i].bound > distance) continue;
    ++near;
    speed = rows.G.row(static_cast<Eigen::Index>(i)).norm();
  }
  return near == 1 ? speed : 0.0;
}

double least_bound(const ConstraintRows& rows) {
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < rows.count; ++i) least = std::min(least, rows.origins[i].bound);
  return least;
}

// The way of all places within a distance away from what is there.
Eigen::VectorXd way_out(const ConstraintRows& rows, double distance) {
  Eigen::VectorXd away = Eigen::VectorXd::Zero(rows.G.cols());
  for (std::size_t i = 0; i < rows.count; ++i) {
    if (rows.origins[i].bound > distance) continue;
    away -= rows.G.row(static_cast<Eigen::Index>(i)).transpose();
  }
  return away;
}

// A point within the stop distance of a link, or in it, is left on command: the retreat is free.
TEST(ControlLoop, LeavesTheStopDistance) {
  ControlRobot robot = test::demo_control_robot();
  test::Rng rng(482);
  int left = 0;
  const int scenes = test::scaled(200);
  for (int scene = 0; scene < scenes; ++scene) {
    Eigen::VectorXd q;
    Loop loop(&robot, RowConfig());
    const double inside = scene % 10 == 0 ? -0.005 : 0.002;
    CloudSnapshot cloud;
    double speed = 0.0;
    // A place that joints can move, of one link alone.
    while (speed < 0.1) {
      q = robot.random_position(&rng);
      robot.place(q);
      const Points points = {robot.point_near(&rng, test::uniform(&rng, inside, 0.04))};
      cloud = test::make_snapshot(points);
      if (robot.exact_distance(points) > 0.045) continue;
      loop.begin(q);
      loop.add(cloud, 0.0);
      speed = speed_of_only(loop.rows(), 1.2 * loop.config.stop_distance);
    }
    for (int cycle = 0; cycle < 500; ++cycle) {
      loop.begin(q);
      loop.add(cloud, 0.0);
      if (least_bound(loop.rows()) > loop.config.stop_distance) {
        ++left;
        break;
      }
      q += loop.config.horizon * loop.filtered(way_out(loop.rows(), loop.config.stop_distance), q);
    }
  }
  EXPECT_EQ(left, scenes);
}

}  // namespace
}  // namespace ist
