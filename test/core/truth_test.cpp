// Compares every answer with the exact truth: a real robot's meshes among recorded depth images.

#include "support/truth.h"

#include <gtest/gtest.h>

#include "internal/robot/anytime_model.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "support/data_dir.h"
#include "support/sanitizers.h"

namespace ist {
namespace {

// The truth and the clouds are in float32 and double, and both are rounded.
constexpr double kRounding = 1e-6;

// How many answers were compared.
struct Counts {
  int without_contact = 0, with_contact = 0;
};

void expect_truth(const LinkProximity& result, const test::TruthRecord& truth, double tolerance) {
  const bool contact = truth.points_inside > 0;
  ASSERT_EQ(result.state, contact ? LinkState::kContact : LinkState::kNear);
  ASSERT_LE(result.distance - result.lower_bound, tolerance + kRounding);
  if (contact) return;
  ASSERT_LE(result.lower_bound, truth.distance + kRounding);
  ASSERT_GE(result.distance, truth.distance - kRounding);
}

// Queries the poses of all cases one after another, so that each is the next one's warm start.
void check_cases(const std::vector<test::TruthCase>& cases, const CloudSnapshot& snapshot,
                 const std::shared_ptr<const RobotModel>& model, double tolerance, Counts* counts) {
  QueryConfig config;
  config.max_distance = 10.0;
  config.tolerance = tolerance;
  ProximityQuery query(model, config);
  const std::vector<bool> known(test::kPandaLinks, true);
  std::vector<LinkProximity> results;
  for (std::size_t k = 0; k < cases.size(); k += test::kStride) {
    query.run(cases[k].X_FL, known, {&snapshot}, &results);
    for (std::size_t i = 0; i < results.size(); ++i) {
      const test::TruthRecord& truth = cases[k].links[i];
      ASSERT_NO_FATAL_FAILURE(expect_truth(results[i], truth, tolerance));
      truth.points_inside > 0 ? ++counts->with_contact : ++counts->without_contact;
    }
  }
}

// The model grows from its first packing to its last step, as a node takes them: coarse fields of
// all links, fine ones, then finer spheres. Every tenth part of the way it answers all cases of one
// cloud.
TEST(Truth, HoldsAtTenPointsOfAGrowingModel) {
  const auto data = test::data_dir();
  if (!data) GTEST_SKIP() << test::kNoData;
  RobotModelConfig config;
  config.packing.max_error = test::packed_to(0.005);
  const auto robot = std::make_shared<const RobotDescription>(test::panda_description(*data));
  std::vector<AnytimeModel::Ptr> stages = {
      AnytimeModel::build(robot, config, AnytimeModel::Stage::kFirst)};
  using LinkStep = AnytimeModel::LinkStep;
  for (const auto step : {LinkStep::kCoarseField, LinkStep::kFineField, LinkStep::kSpheres}) {
    for (std::size_t i = 0; i < test::kPandaLinks; ++i) {
      while (AnytimeModel::next_step(stages.back()->robot()->links[i]) == step) {
        stages.push_back(stages.back()->advanced(i));
      }
    }
  }
  constexpr std::size_t kPoints = 10;
  const CloudSnapshot snapshot = test::truth_cloud(*data, "mosd10");
  const std::vector<test::TruthCase> cases = test::truth_cases(*data, "mosd10", "traj");
  Counts counts;
  for (std::size_t k = 0; k < kPoints; ++k) {
    const auto& stage = stages[k * (stages.size() - 1) / (kPoints - 1)];
    SCOPED_TRACE("point " + std::to_string(k));
    ASSERT_NO_FATAL_FAILURE(check_cases(cases, snapshot, stage->robot(), 0.001, &counts));
  }
  EXPECT_EQ(counts.without_contact + counts.with_contact,
            static_cast<int>(kPoints) * test::scaled(1100));
}

}  // namespace
}  // namespace ist
