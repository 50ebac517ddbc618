// Sequences of queries of link against link that change poses, settings and deadlines in between.
// Bounds hold at every answer, against brute force in double.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/proximity/self_query.h"
#include "support/broken_promise.h"
#include "support/random_links.h"
#include "support/random_numbers.h"
#include "support/sanitizers.h"
#include "support/scene.h"

namespace ist {
namespace {

QueryConfig random_config(test::Rng* rng) {
  constexpr double kTolerances[] = {0.0, 0.0, 0.0, 1e-5, 0.001, 0.01};
  QueryConfig config;
  config.tolerance = kTolerances[test::below(rng, 6)];
  config.max_distance = test::power_of_ten(rng, -2.0, 1.0);
  config.margin = test::chance(rng, 0.7) ? 0.0 : test::uniform(rng, 0.0, 0.05);
  config.relative_tolerance = test::chance(rng, 0.7) ? 0.0 : test::uniform(rng, 0.0, 1.0);
  if (test::chance(rng, 0.3))
    config.deadline = test::chance(rng, 0.3) ? 1e-12 : test::power_of_ten(rng, -6.5, -4.0);
  return config;
}

TEST(HostilePairs, BoundsHold) {
  test::Rng rng(2212);
  const std::vector<LinkGeometry> links = test::random_links(&rng);
  const auto model = test::model_of(links, 0.02);
  const std::vector<test::PairBody> bodies(links.begin(), links.end());
  const auto is_closed = [&](std::size_t i) { return model->links[i].solid.is_closed(); };
  const std::vector<bool> known(links.size(), true);
  const int sequences = test::scaled(400);
  int answers = 0, contacts = 0, stopped = 0;
  for (int i = 0; i < sequences && !testing::Test::HasFailure(); ++i) {
    const std::size_t a = test::below(&rng, links.size());
    const std::size_t b = (a + 1 + test::below(&rng, links.size() - 1)) % links.size();
    SCOPED_TRACE("sequence " + std::to_string(i) + ", links " + std::to_string(a) + ", " +
                 std::to_string(b));
    std::vector<Eigen::Isometry3d> X_FL(links.size(), test::random_pose(&rng, 1.0));
    X_FL[b].translation() += test::random_vector(&rng, 0.2);
    X_FL[b].linear() = test::random_pose(&rng, 0.0).linear();
    QueryConfig config = random_config(&rng);
    SelfQuery query(model, {{a, b}}, config);
    for (int step = 0; step < 20 && !testing::Test::HasFailure(); ++step) {
      if (test::chance(&rng, 0.3)) query.set_config(config = random_config(&rng));
      Eigen::Isometry3d& X = X_FL[test::chance(&rng, 0.5) ? a : b];
      if (test::chance(&rng, 0.7)) X = X * test::small_motion(&rng, -1.3);
      if (test::chance(&rng, 0.05)) X = X * test::random_pose(&rng, 0.2);
      std::vector<PairProximity> found;
      const bool is_complete = query.run(X_FL, known, &found);
      test::PairTruth truth = test::pair_truth(bodies[a], bodies[b], X_FL[a].inverse() * X_FL[b],
                                               is_closed(a) && is_closed(b));
      truth.scale = 1.0 + X_FL[a].translation().norm() + X_FL[b].translation().norm();
      EXPECT_EQ(test::broken_promise(found[0], truth, config, is_complete), "") << "step " << step;
      ++answers;
      contacts += found[0].state == LinkState::kContact ? 1 : 0;
      stopped += is_complete ? 0 : 1;
    }
  }
  if (testing::Test::HasFailure()) return;
  EXPECT_GT(contacts, answers / 20);
  EXPECT_GT(stopped, answers / 100);
}

}  // namespace
}  // namespace ist
