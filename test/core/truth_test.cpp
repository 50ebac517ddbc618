// Compares every answer with the exact truth: a real robot's meshes among recorded depth images.

#include "support/truth.h"

#include <gtest/gtest.h>

#include "ist_proximity/proximity/proximity_query.h"
#include "support/data_dir.h"
#include "support/sanitizers.h"

namespace ist {
namespace {

// The truth and the clouds are in float32 and double, and both are rounded.
constexpr double kRounding = 1e-6;

TEST(Truth, BoundsHoldInEveryCase) {
  const auto data = test::data_dir();
  if (!data) GTEST_SKIP() << test::kNoData;
  const auto model = test::panda_model(*data, 0.005);
  const std::vector<bool> known(test::kPandaLinks, true);
  int without_contact = 0, with_contact = 0;
  for (const char* cloud : {"mosd0", "mosd10", "mosd40"}) {
    const CloudSnapshot snapshot = test::truth_cloud(*data, cloud);
    for (const char* motion : {"traj", "rand"}) {
      const std::vector<test::TruthCase> cases = test::truth_cases(*data, cloud, motion);
      for (const double tolerance : {0.0, 0.001}) {
        QueryConfig config;
        config.max_distance = 10.0;
        config.tolerance = tolerance;
        ProximityQuery query(model, config);
        std::vector<LinkProximity> results;
        for (std::size_t k = 0; k < cases.size(); k += test::kStride) {
          const test::TruthCase& truth = cases[k];
          query.run(truth.X_FL, known, {&snapshot}, &results);
          for (std::size_t i = 0; i < results.size(); ++i) {
            const bool contact = truth.links[i].points_inside > 0;
            ASSERT_EQ(results[i].state, contact ? LinkState::kContact : LinkState::kNear);
            ASSERT_LE(results[i].distance - results[i].lower_bound, tolerance + kRounding);
            contact ? ++with_contact : ++without_contact;
            if (contact) continue;
            ASSERT_LE(results[i].lower_bound, truth.links[i].distance + kRounding);
            ASSERT_GE(results[i].distance, truth.links[i].distance - kRounding);
          }
        }
      }
    }
  }
  EXPECT_EQ(without_contact + with_contact, test::scaled(2 * 6600));
  EXPECT_GT(without_contact, test::scaled(2 * 5000));
}

}  // namespace
}  // namespace ist
