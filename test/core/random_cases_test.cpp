// Random links, poses and clouds against brute force: bounds hold and tolerance 0 is exact.

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "support/adversarial_case.h"
#include "support/moved_links.h"
#include "support/random_links.h"
#include "support/sanitizers.h"
#include "support/trial.h"

namespace ist {
namespace {

// The rounding error of float, which decides on which side of a mesh's surface a point is.
constexpr double kRounding = 2e-8;

QueryConfig random_config(test::Rng* rng) {
  constexpr double kTolerances[] = {0.0, 0.0, 0.001, 0.005, 0.05};
  constexpr double kDistances[] = {0.1, 0.3, 1.0, 10.0};
  QueryConfig config;
  config.tolerance = kTolerances[static_cast<std::size_t>(test::uniform(rng, 0, 5))];
  config.max_distance = kDistances[static_cast<std::size_t>(test::uniform(rng, 0, 4))];
  return config;
}

TEST(RandomCases, BoundsHoldAndZeroToleranceIsExact) {
  const int wanted = test::scaled(100000);
  constexpr int kSteps = 3;  // later ones have a warm start
  test::Rng rng(41);
  const std::vector<LinkGeometry> links = test::random_links(&rng);
  const auto model = test::model_of(links, 0.01);
  const std::size_t count = links.size();
  ProximityQuery query(model, {});
  std::vector<LinkProximity> results;
  int cases = 0, contacts = 0, clear = 0;
  while (cases < wanted) {
    // One link at a time is queried with its own cloud; the others are UNKNOWN.
    for (std::size_t i = 0; i < count; ++i) {
      std::vector<bool> known(count, false);
      known[i] = true;
      const std::vector<Eigen::Vector3d> points = test::random_points(
          &rng, links[i], 1 + static_cast<int>(std::pow(test::uniform(&rng, 0, 1), 3) * 40));
      const CloudSnapshot cloud = test::make_snapshot(points, test::random_vector(&rng, 0.1));
      Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();
      for (int step = 0; step < kSteps; ++step, ++cases) {
        const QueryConfig config = random_config(&rng);
        query.set_config(config);
        ASSERT_TRUE(
            query.run(std::vector<Eigen::Isometry3d>(count, X_FL), known, {&cloud}, &results));
        SCOPED_TRACE(::testing::Message()
                     << "case " << cases << ", link " << i << ", " << points.size()
                     << " points, tolerance " << config.tolerance);
        const test::Truth truth = test::truth_of(links[i], X_FL, points, cloud);
        test::expect_truth(results[i], truth, config, X_FL, kRounding);
        contacts += results[i].state == LinkState::kContact ? 1 : 0;
        clear += results[i].state == LinkState::kClear ? 1 : 0;
        X_FL = X_FL * test::random_pose(&rng, step == 0 ? 0.1 : 0.01);
        if (step == 1) X_FL = test::random_pose(&rng, 0.2);
      }
    }
    if (HasFailure()) return;  // the first is enough
  }
  EXPECT_GT(contacts, wanted / 10);
  EXPECT_GT(clear, wanted / 50);
}

// Links that move among obstacles that stay: no bound is above the truth, whatever was kept from
// the pose before.

TEST(MovedLinks, NoKeptBoundIsAboveTheTruth) {
  const test::MovedLinksReport report = test::search_moved_links(1, test::scaled(1500));
  EXPECT_GT(report.answers, 10);
  EXPECT_EQ(report.wrong_bounds, 0)
      << "by " << report.bound_excess << " m, scene " << report.worst_seed;
  EXPECT_LE(report.distance_excess, 0.0);
  EXPECT_LE(report.width_excess, 0.0);
}

// The worst cases that the adversarial search (benchmark/adversarial_search.cpp) has found:
// whatever a promise says holds for them, too.

// Lines of a promise and a genome; lines that begin with # say what was found.
std::vector<std::pair<std::string, std::string>> kept_cases() {
  std::ifstream file(std::string(IST_PROXIMITY_SOURCE_DIR) + "/test/support/adversarial_cases.txt");
  std::vector<std::pair<std::string, std::string>> cases;
  for (std::string line; std::getline(file, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream words(line);
    cases.emplace_back();
    words >> cases.back().first >> cases.back().second;
  }
  return cases;
}

TEST(AdversarialCases, KeepEveryPromise) {
  const auto cases = kept_cases();
  ASSERT_FALSE(cases.empty());
  for (const auto& [promise, text] : cases) {
    SCOPED_TRACE(promise + " " + text);
    const test::Genome genome = test::genome_from(text);
    ASSERT_EQ(genome.size(), test::kGenomeSize);
    const test::Violations found = test::judge(test::AdversarialCase(genome, nullptr));
    for (std::size_t i = 0; i < test::Violations::kCount; ++i) {
      EXPECT_LE(found.excess[i], 0.0) << test::Violations::kNames[i];
    }
  }
}

}  // namespace
}  // namespace ist
