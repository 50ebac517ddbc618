// The nearest velocity against the conditions of optimality, and what a filter makes of input that
// cannot be used.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "ist_proximity/control/velocity_filter.h"
#include "support/allocations.h"
#include "support/random_numbers.h"
#include "support/sanitizers.h"

namespace ist {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

struct Problem {
  ConstraintRows rows;
  JointLimits limits;
  std::vector<double> weights, command, q;
};

ConstraintRows empty_rows(Eigen::Index count, Eigen::Index joints) {
  ConstraintRows rows;
  rows.horizon = 0.02;
  rows.count = static_cast<std::size_t>(count);
  rows.G.setZero(count, joints);
  rows.sweep.setZero(count, joints);
  rows.h.setConstant(count, kInf);
  rows.sweep_limit.setConstant(count, 1.0);
  rows.radius.setZero(count);
  rows.origins.resize(rows.count);
  rows.is_complete = true;
  return rows;
}

// Which velocity is known to meet all bounds.
enum class MetBy { kZero, kAnother, kUnknown };

// A row may be parallel, opposite or equal to the one before, of zeros, or have limits of 0.
void fill_row(test::Rng* rng, Eigen::Index i, MetBy met_by, ConstraintRows* rows) {
  for (Eigen::Index k = 0; k < rows->G.cols(); ++k) {
    rows->G(i, k) = test::chance(rng, 0.2) ? 0.0 : test::uniform(rng, -1.0, 1.0);
    rows->sweep(i, k) = test::chance(rng, 0.2) ? 0.0 : test::uniform(rng, 0.0, 1.5);
  }
  rows->h[i] = test::uniform(rng, met_by == MetBy::kZero ? 0.0 : -0.2, 0.8);
  rows->sweep_limit[i] = test::chance(rng, 0.05) ? 0.0 : test::uniform(rng, 0.1, 4.0);
  if (i > 0 && test::chance(rng, 0.2)) {
    rows->G.row(i) = (test::chance(rng, 0.3) ? -1.0 : 1.0) * rows->G.row(i - 1);
    if (test::chance(rng, 0.5)) rows->h[i] = rows->h[i - 1];
    rows->sweep.row(i) = rows->sweep.row(i - 1);
  }
  if (test::chance(rng, 0.1)) rows->h[i] = 0.0;
  if (test::chance(rng, 0.05)) rows->G.row(i).setZero();
  if (rows->G.row(i).isZero(0.0)) rows->h[i] = std::abs(rows->h[i]);
}

Problem random_problem(test::Rng* rng, std::size_t joints, std::size_t count, MetBy met_by) {
  Problem problem;
  ConstraintRows& rows = problem.rows;
  rows = empty_rows(static_cast<Eigen::Index>(count), static_cast<Eigen::Index>(joints));
  for (std::size_t k = 0; k < joints; ++k) {
    problem.limits.speed.push_back(test::uniform(rng, 0.2, 2.0));
    problem.weights.push_back(test::power_of_ten(rng, -1.0, 1.0));
    problem.command.push_back(test::uniform(rng, -3.0, 3.0));
    problem.q.push_back(0.0);
  }
  for (Eigen::Index i = 0; i < rows.G.rows(); ++i) fill_row(rng, i, met_by, &rows);
  if (met_by != MetBy::kAnother) return problem;
  Eigen::VectorXd velocity(rows.G.cols());
  for (std::size_t k = 0; k < joints; ++k) {
    velocity[static_cast<Eigen::Index>(k)] =
        problem.limits.speed[k] * test::uniform(rng, -1.0, 1.0);
  }
  rows.h = rows.h.cwiseMax(rows.G * velocity);
  rows.sweep_limit = rows.sweep_limit.cwiseMax(rows.sweep * velocity.cwiseAbs());
  return problem;
}

// The same where a retreat is free, and not asked for: what a share of the command has to meet.
Problem without_retreats(Problem problem) {
  problem.rows.h = problem.rows.h.cwiseMax(0.0);
  return problem;
}

// Every linear inequality a y <= b of a problem in y = sqrt(weight) * velocity.
struct Inequalities {
  std::vector<Eigen::VectorXd> a;
  std::vector<double> b;
  Eigen::VectorXd target, scale;

  explicit Inequalities(const Problem& problem) {
    const auto n = static_cast<Eigen::Index>(problem.command.size());
    scale = Eigen::Map<const Eigen::VectorXd>(problem.weights.data(), n).cwiseSqrt();
    target = scale.cwiseProduct(Eigen::Map<const Eigen::VectorXd>(problem.command.data(), n));
    for (Eigen::Index k = 0; k < n; ++k) {
      const double speed = scale[k] * problem.limits.speed[static_cast<std::size_t>(k)];
      add(Eigen::VectorXd::Unit(n, k), speed);
      add(-Eigen::VectorXd::Unit(n, k), speed);
    }
    const ConstraintRows& rows = problem.rows;
    for (Eigen::Index i = 0; i < rows.G.rows(); ++i) {
      add(rows.G.row(i).transpose().cwiseQuotient(scale), rows.h[i]);
      for (int signs = 0; signs < 1 << n; ++signs) {
        Eigen::VectorXd sweep = rows.sweep.row(i).transpose().cwiseQuotient(scale);
        for (Eigen::Index k = 0; k < n; ++k) sweep[k] *= (signs >> k & 1) != 0 ? -1.0 : 1.0;
        add(sweep, rows.sweep_limit[i]);
      }
    }
  }
  void add(const Eigen::VectorXd& normal, double limit) {
    if (normal.isZero(0.0)) return;
    a.push_back(normal / normal.norm());
    b.push_back(limit / normal.norm());
  }

  // [m/s] What the velocity exceeds a bound by.
  double excess(const std::vector<double>& velocity) const { return excess_of(scaled(velocity)); }
  double excess_of(const Eigen::VectorXd& y) const {
    double excess = 0.0;
    for (std::size_t i = 0; i < a.size(); ++i) excess = std::max(excess, a[i].dot(y) - b[i]);
    return excess;
  }
  Eigen::VectorXd scaled(const std::vector<double>& velocity) const {
    return scale.cwiseProduct(Eigen::Map<const Eigen::VectorXd>(velocity.data(), scale.size()));
  }

  // [m/s] What every velocity exceeds some bound by, for one joint or two: one of the velocities
  // that meet exactly as many bounds as there are joints meets all, where any does.
  double least_excess() const {
    double least = kInf;
    const auto consider = [&](const Eigen::VectorXd& y) { least = std::min(least, excess_of(y)); };
    for (std::size_t i = 0; i < a.size(); ++i) {
      if (scale.size() == 1) consider(b[i] * a[i]);
      for (std::size_t j = 0; scale.size() == 2 && j < i; ++j) {
        const double det = a[i][0] * a[j][1] - a[i][1] * a[j][0];
        if (std::abs(det) < 1e-12) continue;
        consider(Eigen::Vector2d(a[j][1] * b[i] - a[i][1] * b[j], a[i][0] * b[j] - a[j][0] * b[i]) /
                 det);
      }
    }
    return least;
  }

  // What the conditions of Karush, Kuhn and Tucker are missed by: how far the way from the velocity
  // to the target is from every sum, with factors >= 0, of normals of bounds that the velocity just
  // meets. As many normals as there are joints suffice (Caratheodory), so all such sets are tried.
  double kkt_residual(const std::vector<double>& velocity) const {
    const Eigen::VectorXd y = scaled(velocity);
    std::vector<Eigen::VectorXd> active;
    for (std::size_t i = 0; i < a.size(); ++i) {
      if (a[i].dot(y) < b[i] - 1e-7) continue;
      const bool is_new = std::none_of(active.begin(), active.end(), [&](const auto& other) {
        return (a[i] - other).norm() < 1e-12;
      });
      if (is_new) active.push_back(a[i]);
    }
    double least = (target - y).norm();
    try_normals(active, 0, Eigen::MatrixXd(scale.size(), 0), target - y, &least);
    return least;
  }
  static void try_normals(const std::vector<Eigen::VectorXd>& active, std::size_t from,
                          const Eigen::MatrixXd& normals, const Eigen::VectorXd& way,
                          double* least) {
    if (normals.cols() == normals.rows()) return;
    for (std::size_t i = from; i < active.size() && *least > 1e-7; ++i) {
      Eigen::MatrixXd more(normals.rows(), normals.cols() + 1);
      more << normals, active[i];
      const Eigen::VectorXd factors = more.colPivHouseholderQr().solve(way);
      if (factors.minCoeff() > -1e-7) *least = std::min(*least, (more * factors - way).norm());
      try_normals(active, i + 1, more, way, least);
    }
  }
};

// Every answer meets all bounds and the conditions of optimality; a contradiction is one.
TEST(VelocityFilter, IsNearestInRandomProblems) {
  test::Rng rng(461);
  int limited = 0, contradictions = 0;
  for (int trial = 0; trial < test::scaled(10000); ++trial) {
    const std::size_t joints = 1 + test::below(&rng, 4);
    const MetBy met_by = joints < 3 && trial % 3 == 0 ? MetBy::kUnknown
                         : trial % 3 == 1             ? MetBy::kAnother
                                                      : MetBy::kZero;
    const Problem problem = random_problem(&rng, joints, test::below(&rng, 12), met_by);
    VelocityFilter filter(problem.limits, problem.weights);
    const FilterAnswer& answer = filter.run(problem.command, problem.q, problem.rows);
    const Inequalities all(problem);
    if (answer.reason == FilterReason::kContradiction) {
      ++contradictions;
      ASSERT_EQ(met_by, MetBy::kUnknown) << trial;
      ASSERT_GT(all.least_excess(), 1e-12) << trial;
      ASSERT_FALSE(answer.rows.empty()) << trial;
      ASSERT_LT(Inequalities(without_retreats(problem)).excess(answer.velocity), 1e-8) << trial;
      continue;
    }
    ASSERT_EQ(answer.reason, FilterReason::kNone) << trial;
    ASSERT_LT(all.excess(answer.velocity), 1e-8) << trial;
    limited += answer.status == FilterStatus::kLimited ? 1 : 0;
    if (answer.status == FilterStatus::kFree) ASSERT_EQ(answer.velocity, problem.command) << trial;
    ASSERT_LT(all.kkt_residual(answer.velocity), 1e-6) << trial;
  }
  EXPECT_GT(limited, test::scaled(4000));
  EXPECT_GT(contradictions, test::scaled(300));
}

// The answer meets the bounds with as many rows and joints as an arm has, and allocates nothing.
TEST(VelocityFilter, MeetsFortyRowsWithoutAllocation) {
  test::Rng rng(462);
  for (int trial = 0; trial < test::scaled(1000); ++trial) {
    const Problem problem =
        random_problem(&rng, 7, 40, trial % 2 == 0 ? MetBy::kZero : MetBy::kAnother);
    VelocityFilter filter(problem.limits, problem.weights);
    const long before = test::allocations;
    const FilterAnswer& answer = filter.run(problem.command, problem.q, problem.rows);
    ASSERT_EQ(test::allocations - before, 0);
    ASSERT_EQ(answer.reason, FilterReason::kNone) << trial;
    ASSERT_LT(Inequalities(problem).excess(answer.velocity), 1e-8) << trial;
  }
}

void expect_standing(const FilterAnswer& answer, FilterReason reason) {
  EXPECT_EQ(answer.status, FilterStatus::kFault);
  EXPECT_EQ(answer.reason, reason);
  EXPECT_EQ(answer.velocity, std::vector<double>(2, 0.0));
  EXPECT_FALSE(std::string(sentence(answer.reason)).empty());
}

TEST(VelocityFilter, StandsWhereAnInputCannotBeUsed) {
  VelocityFilter filter({{1.0, 1.0}, {}, {}, {}});
  const ConstraintRows good = empty_rows(1, 2);
  const std::vector<double> zero = {0.0, 0.0}, command = {0.5, -0.5};
  EXPECT_EQ(filter.run(command, zero, good).status, FilterStatus::kFree);
  for (const double bad : {std::nan(""), kInf, -kInf}) {
    expect_standing(filter.run({bad, 0.0}, zero, good), FilterReason::kCommand);
    expect_standing(filter.run(command, {0.0, bad}, good), FilterReason::kPositions);
  }
  expect_standing(filter.run({0.1}, zero, good), FilterReason::kCommand);
  expect_standing(filter.run({0.1, 0.1, 0.1}, zero, good), FilterReason::kCommand);
  expect_standing(filter.run(command, {}, good), FilterReason::kPositions);
  expect_standing(filter.run(command, zero, empty_rows(1, 3)), FilterReason::kRows);
  expect_standing(filter.run(command, zero, ConstraintRows()), FilterReason::kRows);
  void (*const faults[])(ConstraintRows*) = {
      [](ConstraintRows* rows) { rows->h[0] = std::nan(""); },
      [](ConstraintRows* rows) { rows->sweep(0, 1) = -1.0; },
      [](ConstraintRows* rows) { rows->horizon = 0.0; },
      [](ConstraintRows* rows) { rows->count = 2; }};
  for (const auto& make_fault : faults) {
    ConstraintRows bad = good;
    make_fault(&bad);
    expect_standing(filter.run(command, zero, bad), FilterReason::kRows);
  }
}

// A joint without a speed limit that is to be endlessly fast excuses none of the other ones.
TEST(VelocityFilter, KeepsRowsBesideCommandsAsLargeAsNumbersAre) {
  VelocityFilter filter({{kInf, kInf}, {}, {}, {}});
  ConstraintRows rows = empty_rows(1, 2);
  rows.G(0, 0) = rows.sweep(0, 0) = 1.0;
  rows.h[0] = rows.sweep_limit[0] = 0.01;
  for (const double fast : {1.0, 1e9, 1e12, 1e300}) {
    const FilterAnswer& answer = filter.run({0.5, fast}, {0.0, 0.0}, rows);
    EXPECT_LT(answer.velocity[0], 0.01 + 1e-8) << fast;
    EXPECT_GT(answer.velocity[0], 0.01 - 1e-8) << fast;
  }
}

// Beside such a command the solver neglects the limit of a slower joint, which holds all the same.
// The answer was FREE.
TEST(VelocityFilter, NamesTheSlowJointBesideAFastOne) {
  JointLimits limits;
  limits.speed = {1.0, kInf};
  VelocityFilter filter(limits);
  const FilterAnswer& answer = filter.run({1.5, 1e12}, {0.0, 0.0}, empty_rows(0, 2));
  EXPECT_EQ(answer.velocity, (std::vector<double>{1.0, 1e12}));
  EXPECT_EQ(answer.status, FilterStatus::kLimited);
  EXPECT_EQ(answer.joints, std::vector<std::size_t>{0});
}

// An infinite sum was within its own rounding of every limit, and the difference of two was none
// of a row's concern: the command was given as it is.
TEST(VelocityFilter, KeepsRowsWhoseSumsAreTooLargeForNumbers) {
  constexpr double kHuge = 1.5e308;
  VelocityFilter filter({{kInf, kInf}, {}, {}, {}});
  ConstraintRows rows = empty_rows(1, 2);
  rows.sweep.row(0) << 2.0, 1.0;
  rows.sweep_limit[0] = 0.01;
  for (const double other : {0.0, kHuge, -kHuge}) {
    const FilterAnswer& answer = filter.run({kHuge, other}, {0.0, 0.0}, rows);
    EXPECT_LE(2.0 * std::abs(answer.velocity[0]) + std::abs(answer.velocity[1]), 0.011) << other;
  }
  rows = empty_rows(1, 2);
  rows.sweep_limit[0] = kInf;
  rows.G.row(0) << 4.0, -4.0;
  rows.h[0] = 0.01;
  const FilterAnswer& answer = filter.run({kHuge, 0.5 * kHuge}, {0.0, 0.0}, rows);
  EXPECT_LE(answer.velocity[0] - answer.velocity[1], 0.0025);
}

TEST(VelocityFilter, KeepsPositionLimits) {
  VelocityFilter filter({{1.0, 1.0}, {-1.0, -1.0}, {1.0, 1.0}, {}});
  ConstraintRows rows = empty_rows(0, 2);
  rows.horizon = 0.1;
  const FilterAnswer& near = filter.run({0.9, 0.9}, {0.99, 0.0}, rows);
  EXPECT_NEAR(near.velocity[0], 0.1, 1e-12);
  EXPECT_EQ(near.velocity[1], 0.9);
  EXPECT_EQ(near.joints, std::vector<std::size_t>{0});
  // A joint that is beyond its limit may move back, and no farther out.
  EXPECT_EQ(filter.run({0.9, 0.0}, {1.2, 0.0}, rows).velocity[0], 0.0);
  EXPECT_EQ(filter.run({-0.9, 0.0}, {1.2, 0.0}, rows).velocity[0], -0.9);
  // A joint may have done any part of what it was told, on either side.
  const std::vector<double> moved = {0.04, -0.04};
  for (const double sign : {1.0, -1.0}) {
    const FilterAnswer& told =
        filter.run({0.9 * sign, 0.9 * sign}, {0.95 * sign, 0.95 * sign}, rows, 0.0, moved);
    EXPECT_NEAR(told.velocity[0], sign > 0.0 ? 0.1 : -0.5, 1e-12);
    EXPECT_NEAR(told.velocity[1], sign > 0.0 ? 0.5 : -0.1, 1e-12);
  }
  EXPECT_EQ(filter.run({0.1, 0.0}, {0.0, 0.0}, rows, 0.0, {0.1}).reason, FilterReason::kPositions);
}

TEST(VelocityFilter, LetsAccelerationLimitsGiveWayToRows) {
  VelocityFilter filter({{2.0}, {}, {}, {10.0}}, {}, 0.01);
  ConstraintRows rows = empty_rows(1, 1);
  for (int step = 1; step <= 10; ++step) {
    EXPECT_NEAR(filter.run({1.0}, {0.0}, rows).velocity[0], 0.1 * step, 1e-12);
  }
  rows.G(0, 0) = 1.0;
  rows.h[0] = 0.25;
  const FilterAnswer& braked = filter.run({1.0}, {0.0}, rows);
  EXPECT_EQ(braked.status, FilterStatus::kScaled);
  EXPECT_EQ(braked.reason, FilterReason::kContradiction);
  EXPECT_NEAR(braked.velocity[0], 0.25, 1e-12);
  filter.reset();
  EXPECT_NEAR(filter.run({1.0}, {0.0}, rows).velocity[0], 0.1, 1e-12);
}

TEST(VelocityFilter, StandsBetweenRowsThatContradictAndNamesThem) {
  VelocityFilter filter({{1.0}, {}, {}, {}});
  ConstraintRows rows = empty_rows(3, 1);
  rows.G.col(0) << 0.0, 1.0, -1.0;
  rows.h << kInf, -0.1, -0.1;
  const FilterAnswer& answer = filter.run({0.5}, {0.0}, rows);
  EXPECT_EQ(answer.status, FilterStatus::kStopped);
  EXPECT_EQ(answer.reason, FilterReason::kContradiction);
  std::vector<std::size_t> named = answer.rows;
  std::sort(named.begin(), named.end());
  EXPECT_EQ(named, (std::vector<std::size_t>{1, 2}));
}

TEST(VelocityFilter, ScalesTheCommandWhenTheTimeIsOver) {
  test::Rng rng(463);
  const Problem problem = random_problem(&rng, 7, 40, MetBy::kZero);
  VelocityFilter filter(problem.limits, problem.weights);
  const FilterAnswer& answer = filter.run(problem.command, problem.q, problem.rows, 1e-9);
  EXPECT_EQ(answer.reason, FilterReason::kTime);
  EXPECT_LT(Inequalities(problem).excess(answer.velocity), 1e-8);
}

// The scale is the largest share of the command that meets all bounds: halving finds no other.
TEST(VelocityFilter, ScaleIsTheLargestShareOfTheCommand) {
  test::Rng rng(464);
  int some = 0, none = 0;
  for (int trial = 0; trial < test::scaled(5000); ++trial) {
    const Problem problem = random_problem(&rng, 1 + test::below(&rng, 4), test::below(&rng, 12),
                                           trial % 2 == 0 ? MetBy::kZero : MetBy::kUnknown);
    VelocityFilter filter(problem.limits, problem.weights);
    const double scale = filter.run(problem.command, problem.q, problem.rows).scale;
    const Inequalities all(without_retreats(problem));
    const auto excess = [&](double share) {
      std::vector<double> velocity = problem.command;
      for (double& one : velocity) one *= share;
      return all.excess(velocity);
    };
    ASSERT_GE(scale, 0.0);
    ASSERT_LE(scale, 1.0);
    if (scale > 0.0) ASSERT_LT(excess(scale), 1e-9) << trial;
    for (const double more : {1e-6, 1e-3, 0.1, 0.5, 1.0}) {
      const double share = std::min(scale + more, 1.0);
      if (share > scale) ASSERT_GT(excess(share), 0.0) << trial << ": " << scale << ", " << share;
    }
    ++(scale > 0.0 && scale < 1.0 ? some : none);
  }
  EXPECT_GT(some, test::scaled(1000));
  EXPECT_GT(none, test::scaled(100));
}

// Inside the stop distance the way out is free, and nothing else; beside what is not known,
// nothing.
TEST(VelocityFilter, ScaleLetsTheRobotLeave) {
  VelocityFilter filter({{1.0}, {}, {}, {}});
  ConstraintRows rows = empty_rows(1, 1);
  rows.G(0, 0) = 1.0;
  rows.h[0] = 0.0;
  EXPECT_EQ(filter.run({-0.5}, {0.0}, rows).scale, 1.0);
  EXPECT_EQ(filter.run({0.5}, {0.0}, rows).scale, 0.0);
  rows.h[0] = 0.1;
  EXPECT_NEAR(filter.run({0.5}, {0.0}, rows).scale, 0.2, 1e-12);
  // A slower retreat than the one that is asked for is better than none.
  rows.h[0] = -0.8;
  EXPECT_EQ(filter.run({-0.5}, {0.0}, rows).scale, 1.0);
  EXPECT_EQ(filter.run({0.5}, {0.0}, rows).scale, 0.0);
  rows.sweep(0, 0) = 1.0;
  rows.sweep_limit[0] = 0.1;
  const FilterAnswer& slower = filter.run({-0.5}, {0.0}, rows);
  EXPECT_EQ(slower.status, FilterStatus::kScaled);
  EXPECT_EQ(slower.reason, FilterReason::kContradiction);
  EXPECT_NEAR(slower.velocity[0], -0.1, 1e-12);
  rows.sweep_limit[0] = 0.0;  // the link is UNKNOWN
  EXPECT_EQ(filter.run({-0.5}, {0.0}, rows).scale, 0.0);
  EXPECT_EQ(filter.run({std::nan("")}, {0.0}, rows).scale, 0.0);
  rows.is_complete = false;
  EXPECT_EQ(filter.run({-0.5}, {0.0}, rows).scale, 0.0);
}

TEST(VelocityFilter, RefusesLimitsThatContradict) {
  EXPECT_THROW(VelocityFilter({{1.0}, {1.0}, {0.0}, {}}), std::invalid_argument);
  EXPECT_THROW(VelocityFilter({{1.0}, {}, {0.0, 1.0}, {}}), std::invalid_argument);
  EXPECT_THROW(VelocityFilter({{std::nan("")}, {}, {}, {}}), std::invalid_argument);
  EXPECT_THROW(VelocityFilter({{-1.0}, {}, {}, {}}), std::invalid_argument);
  EXPECT_THROW(VelocityFilter({{1.0}, {}, {}, {}}, {0.0}), std::invalid_argument);
  EXPECT_THROW(VelocityFilter({{1.0}, {}, {}, {}}, {1.0}, 0.0), std::invalid_argument);
}

}  // namespace
}  // namespace ist
