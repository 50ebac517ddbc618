// Anytime models: what holds at every stage of their growth, and queries that take a finer model
// while they are at work.

#include "internal/robot/anytime_model.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "internal/geometry/distance_field.h"
#include "internal/robot/model_memory.h"
#include "support/data_dir.h"
#include "support/demo_arm.h"
#include "support/meshes.h"
#include "support/random_links.h"
#include "support/robot_of_links.h"
#include "support/sanitizers.h"
#include "support/temp_dir.h"
#include "support/trial.h"

namespace ist {
namespace {

using Stage = AnytimeModel::Stage;
constexpr double kMaxError = 0.004;  // [m]
constexpr int kGrowthPoints = 10;

RobotModelConfig config_to(double max_error) {
  RobotModelConfig config;
  config.packing.max_error = test::packed_to(max_error);
  return config;
}

std::shared_ptr<const RobotDescription> robot_of(const std::vector<LinkGeometry>& links) {
  return std::make_shared<const RobotDescription>(test::robot_of(links));
}

std::shared_ptr<const RobotDescription> demo() {
  return std::make_shared<const RobotDescription>(test::demo_robot());
}

// The next link that is not final after `link`, in turn; -1: all are final.
std::ptrdiff_t next_link(const RobotModel& robot, std::ptrdiff_t link) {
  const auto count = static_cast<std::ptrdiff_t>(robot.links.size());
  for (std::ptrdiff_t k = 1; k <= count; ++k) {
    const std::ptrdiff_t next = (link + k) % count;
    if (!robot.links[static_cast<std::size_t>(next)].is_final) return next;
  }
  return -1;
}

// All models from the first stage to the last, one link refined at a time.
std::vector<AnytimeModel::Ptr> growth(AnytimeModel::Ptr model) {
  std::vector<AnytimeModel::Ptr> stages = {std::move(model)};
  for (std::ptrdiff_t link = -1; (link = next_link(*stages.back()->robot(), link)) >= 0;) {
    stages.push_back(stages.back()->refined(static_cast<std::size_t>(link)));
  }
  return stages;
}

// Ten of them, the first and the last among them.
std::vector<AnytimeModel::Ptr> growth_points(const std::vector<AnytimeModel::Ptr>& stages) {
  std::vector<AnytimeModel::Ptr> points;
  for (std::size_t k = 0; k < kGrowthPoints; ++k) {
    points.push_back(stages[k * (stages.size() - 1) / (kGrowthPoints - 1)]);
  }
  return points;
}

// The certificate, against the exact geometry at points about the link.
void expect_certificate(const LinkModel& link, test::Rng* rng) {
  const PackingCertificate& certificate = link.packing.certificate;
  const double size = link.tree.center().norm() + link.tree.radius();
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector3d p = test::random_vector(rng, size);
    const double exact = link.solid.signed_distance(p).distance;
    const double cover = link.tree.cover_distance(p);
    if (exact > 0.0) {
      ASSERT_LE(cover, exact + 1e-9) << link.name;
      ASSERT_LE(link.tree.inner_distance(p), exact + certificate.max_gap + 1e-6) << link.name;
    } else {
      ASSERT_LE(cover, certificate.interior_gap + 1e-9) << link.name;
    }
  }
}

TEST(AnytimeModel, growsLinkByLinkToTheFinalPacking) {
  const RobotModelConfig config = config_to(kMaxError);
  const auto stages = growth(AnytimeModel::build(demo(), config, Stage::kFirst));
  for (std::size_t k = 1; k < stages.size(); ++k) {
    const RobotModel &before = *stages[k - 1]->robot(), &after = *stages[k]->robot();
    EXPECT_TRUE(same_geometry(before, after));
    EXPECT_EQ(memory_of(after).solids, memory_of(before).solids) << "they are there once";
    std::size_t changed = 0;
    for (std::size_t i = 0; i < after.links.size(); ++i) {
      const LinkModel &old = before.links[i], &now = after.links[i];
      EXPECT_LE(now.packing.certificate.max_gap, old.packing.certificate.max_gap) << now.name;
      if (now.packing_id == old.packing_id) {
        EXPECT_EQ(now.packing.spheres.size(), old.packing.spheres.size());
        continue;
      }
      ++changed;
      EXPECT_GT(now.packing.spheres.size(), old.packing.spheres.size()) << now.name;
    }
    EXPECT_EQ(changed, 1U);
  }
  const auto whole = build_robot_model(test::demo_robot(), config);
  for (std::size_t i = 0; i < whole->links.size(); ++i) {
    const LinkModel &grown = stages.back()->robot()->links[i], &packed = whole->links[i];
    EXPECT_TRUE(grown.is_final && packed.is_final);
    ASSERT_EQ(grown.packing.spheres.size(), packed.packing.spheres.size()) << packed.name;
    for (std::size_t s = 0; s < packed.packing.spheres.size(); ++s) {
      ASSERT_EQ(grown.packing.spheres[s].center, packed.packing.spheres[s].center);
      ASSERT_EQ(grown.packing.spheres[s].cover_radius, packed.packing.spheres[s].cover_radius);
    }
  }
}

// A field changes nothing but the time of queries, and stays while packings become finer.
TEST(AnytimeModel, aLinkKeepsItsFieldWhileItIsPackedMoreFinely) {
  const auto first = AnytimeModel::build(demo(), config_to(kMaxError), Stage::kFirst);
  const auto link = static_cast<std::size_t>(next_link(*first->robot(), -1));
  const auto model = first->with_field(link);
  const RobotModel &before = *first->robot(), &after = *model->robot();
  EXPECT_TRUE(same_geometry(before, after));
  EXPECT_EQ(before.links[link].field, nullptr);
  ASSERT_NE(after.links[link].field, nullptr);
  EXPECT_FALSE(after.links[link].field->empty());
  EXPECT_EQ(after.links[link].field->detail(), DistanceField::Detail::kCoarse);
  EXPECT_GT(memory_of(after).fields, 0U);
  for (std::size_t i = 0; i < before.links.size(); ++i) {
    EXPECT_EQ(after.links[i].packing_id, before.links[i].packing_id);
    if (i != link) EXPECT_EQ(after.links[i].field, nullptr);
  }
  const auto finer = model->refined(link);
  EXPECT_NE(finer->robot()->links[link].packing_id, after.links[link].packing_id);
  EXPECT_EQ(finer->robot()->links[link].field, after.links[link].field);
  // A model that has grown meanwhile takes it, too.
  const auto grown = first->refined(link)->with_packings_of(*model);
  EXPECT_EQ(grown->robot()->links[link].field, after.links[link].field);
}

TEST(AnytimeModel, aFineFieldTakesThePlaceOfACoarseOne) {
  const auto first = AnytimeModel::build(demo(), config_to(kMaxError), Stage::kFirst);
  const auto link = static_cast<std::size_t>(next_link(*first->robot(), -1));
  const auto coarse = first->with_field(link), fine = coarse->with_field(link);
  const auto field_of = [&](const AnytimeModel::Ptr& model) {
    return model->robot()->links[link].field;
  };
  EXPECT_EQ(field_of(fine)->detail(), DistanceField::Detail::kFine);
  EXPECT_GT(field_of(fine)->memory(), 3 * field_of(coarse)->memory());
  EXPECT_EQ(field_of(coarse->with_packings_of(*fine)), field_of(fine));
  EXPECT_EQ(field_of(fine->with_packings_of(*coarse)), field_of(fine));
}

// Only final packings are kept, and a start with a full cache has them at once.
TEST(AnytimeModel, keepsFinalPackingsInTheCache) {
  const test::TempDir dir;
  RobotModelConfig config = config_to(kMaxError);
  config.cache_directory = dir.file("cache");
  const auto first = AnytimeModel::build(demo(), config, Stage::kFirst);
  const auto again = AnytimeModel::build(demo(), config, Stage::kFirst);
  for (std::size_t i = 0; i < first->robot()->links.size(); ++i) {
    const LinkModel &one = first->robot()->links[i], &two = again->robot()->links[i];
    EXPECT_FALSE(one.from_cache);
    EXPECT_EQ(two.from_cache, one.is_final) << one.name;
  }
  const auto grown = growth(first).back();
  const auto cached = AnytimeModel::build(demo(), config, Stage::kFirst);
  for (std::size_t i = 0; i < cached->robot()->links.size(); ++i) {
    const LinkModel& link = cached->robot()->links[i];
    EXPECT_TRUE(link.from_cache && link.is_final) << link.name;
    EXPECT_EQ(link.packing.spheres.size(), grown->robot()->links[i].packing.spheres.size());
  }
}

TEST(AnytimeModel, tellsALimitThatWasReachedAtTheEndOnly) {
  RobotModelConfig config = config_to(0.0005);
  config.packing.max_spheres = 60;
  std::vector<std::string> warnings;
  RobotModelCallbacks callbacks;
  callbacks.warning = [&](const std::string& text) { warnings.push_back(text); };
  const std::vector<LinkGeometry> links = {test::one(test::torus(0.1, 0.03, 24, 12))};
  auto model = AnytimeModel::build(robot_of(links), config, Stage::kFirst, callbacks);
  EXPECT_TRUE(warnings.empty());
  while (!model->robot()->links[0].is_final) model = model->refined(0, callbacks);
  EXPECT_LE(model->robot()->links[0].packing.spheres.size(), 60U);
  EXPECT_FALSE(model->robot()->links[0].packing.certificate.reached);
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_NE(warnings[0].find("max_spheres (60)"), std::string::npos) << warnings[0];
}

// A link without its solid would be clear of everything.
TEST(AnytimeModel, refusesAnElementThatIsNowhere) {
  for (const double x : {1e6, std::numeric_limits<double>::quiet_NaN()}) {
    LinkGeometry geometry = test::one(test::torus(0.1, 0.03, 24, 12));
    geometry[0].X_LE.translation().x() = x;
    const auto model =
        AnytimeModel::build(robot_of({geometry}), config_to(kMaxError), Stage::kFirst);
    const LinkModel& link = model->robot()->links[0];
    EXPECT_FALSE(link.usable()) << x;
    EXPECT_NE(link.error.find("its origin"), std::string::npos) << link.error;
  }
}

TEST(AnytimeModel, canBeCancelledAtEveryStep) {
  RobotModelCallbacks callbacks;
  callbacks.cancelled = [] { return true; };
  EXPECT_EQ(AnytimeModel::build(demo(), {}, Stage::kFirst, callbacks), nullptr);
  const auto first = AnytimeModel::build(demo(), config_to(kMaxError), Stage::kFirst);
  const std::ptrdiff_t link = next_link(*first->robot(), -1);
  if (link < 0) GTEST_SKIP() << "packed coarsely";
  EXPECT_EQ(first->refined(static_cast<std::size_t>(link), callbacks), nullptr);
  EXPECT_EQ(first->with_field(static_cast<std::size_t>(link), callbacks), nullptr);
  EXPECT_EQ(first->with_link(demo(), first->robot()->links[0].name, {}, callbacks), nullptr);
}

// An object that is attached while packing goes on: links keep the packings that they have, those
// that come in from a step begun before are taken over, and detaching restores the model.
TEST(AnytimeModel, linksWithObjectsKeepTheirPackings) {
  const RobotModelConfig config = config_to(kMaxError);
  const auto first = AnytimeModel::build(demo(), config, Stage::kFirst);
  const std::ptrdiff_t link = next_link(*first->robot(), -1);
  if (link < 0) GTEST_SKIP() << "packed coarsely";
  const LinkModel& bare = first->robot()->links[static_cast<std::size_t>(link)];
  AttachedObject ball;
  ball.name = "ball";
  ball.link = bare.name;
  ball.element.shape = Sphere{0.05};
  const auto with_ball =
      std::make_shared<const RobotDescription>(with_objects(first->description(), {ball}));
  const auto carrying = first->with_link(with_ball, bare.name, config);
  EXPECT_FALSE(same_geometry(*first->robot(), *carrying->robot()));
  const auto at = static_cast<std::size_t>(link);
  EXPECT_EQ(carrying->robot()->links[at].packing.spheres.size(), bare.packing.spheres.size() + 1);
  EXPECT_FALSE(carrying->robot()->links[at].is_final);
  for (std::size_t i = 0; i < carrying->robot()->links.size(); ++i) {
    if (i == at) continue;
    EXPECT_EQ(carrying->robot()->links[i].packing_id, first->robot()->links[i].packing_id);
  }
  const auto merged = carrying->with_packings_of(*first->refined(at));
  EXPECT_TRUE(same_geometry(*merged->robot(), *carrying->robot()));
  EXPECT_GT(merged->robot()->links[at].packing.spheres.size(),
            carrying->robot()->links[at].packing.spheres.size());
  EXPECT_EQ(merged->with_packings_of(*first)->robot()->links[at].packing.spheres.size(),
            merged->robot()->links[at].packing.spheres.size())
      << "coarser packings are not taken";
  const auto detached = merged->with_link(demo(), bare.name, config);
  EXPECT_EQ(detached->robot()->links[at].packing.spheres.size() + 1,
            merged->robot()->links[at].packing.spheres.size());
}

// Links of every kind, and ten points of their growth. Made once.
struct Grown {
  Grown() {
    test::Rng rng(72);
    links = test::random_links(&rng);
    links.resize(links.size() - 3);  // three soups: slow, and much like each other
    stages = growth(AnytimeModel::build(robot_of(links), config_to(kMaxError), Stage::kFirst));
  }
  std::vector<LinkGeometry> links;
  std::vector<AnytimeModel::Ptr> stages;
};
const Grown& grown_links() {
  static const Grown grown;
  return grown;
}

TEST(AnytimeModel, certificatesHoldAtEveryStage) {
  test::Rng rng(72);
  const auto& stages = grown_links().stages;
  ASSERT_GE(stages.size(), test::kSanitized ? 1U : kGrowthPoints);
  for (const AnytimeModel::Ptr& model : growth_points(stages)) {
    for (const LinkModel& link : model->robot()->links) {
      ASSERT_NO_FATAL_FAILURE(expect_certificate(link, &rng));
    }
  }
}

// Motions of a query that takes a finer model now and then.
struct GrowingQuery {
  explicit GrowingQuery(std::uint64_t seed, double tolerance) : rng(seed) {
    links = grown_links().links;
    stages = growth_points(grown_links().stages);
    config.tolerance = tolerance;
    config.max_distance = 0.5;
    X_FL.assign(links.size(), Eigen::Isometry3d::Identity());
    known.assign(links.size(), true);
    query = std::make_unique<ProximityQuery>(stages[0]->robot(), config);
    change_cloud();
  }

  void change_cloud() {
    points.clear();
    const int count = 5 + static_cast<int>(test::uniform(&rng, 0, 40));
    for (int i = 0; i < count; ++i) points.push_back(test::random_vector(&rng, 0.5));
    cloud = test::make_snapshot(points, test::random_vector(&rng, 0.1));
    for (Eigen::Isometry3d& X : X_FL) X = test::random_pose(&rng, 0.4);
  }
  void move(double size) {
    for (Eigen::Isometry3d& X : X_FL) {
      X.translation() += test::random_vector(&rng, size);
      X.linear() = (Eigen::AngleAxisd(test::uniform(&rng, -size, size),
                                      test::random_vector(&rng, 1.0).normalized()) *
                    X.linear());
      X.linear() = Eigen::Quaterniond(X.linear()).normalized().toRotationMatrix();
    }
  }
  test::Truth truth(std::size_t i) const {
    return test::truth_of(links[i], X_FL[i], points, cloud);
  }

  test::Rng rng;
  std::vector<LinkGeometry> links;
  std::vector<AnytimeModel::Ptr> stages;
  QueryConfig config;
  std::unique_ptr<ProximityQuery> query;
  std::vector<Eigen::Isometry3d> X_FL;
  std::vector<bool> known;
  std::vector<Eigen::Vector3d> points;
  CloudSnapshot cloud;
  std::vector<LinkProximity> results;
};

class AnytimeQuery : public ::testing::TestWithParam<double> {};

TEST_P(AnytimeQuery, answersAreTrueAtTenPointsOfTheGrowth) {
  GrowingQuery growing(73, GetParam());
  constexpr int kSteps = 4;  // later ones have bounds to keep
  const int rounds = test::scaled(3);
  int contacts = 0;
  for (int round = 0; round < rounds; ++round) {
    if (round > 0) {
      growing.change_cloud();
      growing.query = std::make_unique<ProximityQuery>(growing.stages[0]->robot(), growing.config);
    }
    for (const AnytimeModel::Ptr& stage : growing.stages) {
      growing.query->set_model(stage->robot());
      for (int step = 0; step < kSteps; ++step) {
        ASSERT_TRUE(
            growing.query->run(growing.X_FL, growing.known, {&growing.cloud}, &growing.results));
        for (std::size_t i = 0; i < growing.links.size(); ++i) {
          SCOPED_TRACE("link " + std::to_string(i) + ", step " + std::to_string(step));
          test::expect_truth(growing.results[i], growing.truth(i), growing.config, growing.X_FL[i]);
          contacts += growing.results[i].state == LinkState::kContact ? 1 : 0;
        }
        if (HasFailure()) return;
        growing.move(step % 2 == 0 ? 1e-3 : 1e-5);
      }
    }
  }
  EXPECT_GT(contacts, 0);
}

INSTANTIATE_TEST_SUITE_P(Tolerances, AnytimeQuery, ::testing::Values(0.0, 0.001, 0.02));

// Nothing known is lost in a swap: where there is no time to search, the bound that was proven with
// the old packing is the answer's, less the displacement.
TEST(AnytimeQuery, boundsSurviveASwapWithoutASearch) {
  GrowingQuery growing(74, 0.001);
  int positive = 0;
  for (int round = 0; round < 5; ++round) {
    growing.change_cloud();
    for (std::size_t s = 0; s + 1 < growing.stages.size(); ++s) {
      ProximityQuery query(growing.stages[s]->robot(), growing.config);
      ASSERT_TRUE(query.run(growing.X_FL, growing.known, {&growing.cloud}, &growing.results));
      const std::vector<LinkProximity> before = growing.results;
      query.set_model(growing.stages[s + 1]->robot());
      constexpr double kStep = 1e-5;
      growing.move(kStep);
      QueryConfig no_time = growing.config;
      no_time.deadline = 1e-12;
      query.set_config(no_time);
      query.run(growing.X_FL, growing.known, {&growing.cloud}, &growing.results);
      for (std::size_t i = 0; i < before.size(); ++i) {
        ASSERT_LE(growing.results[i].lower_bound,
                  std::max(growing.truth(i).measured, growing.truth(i).stored) + 2e-8);
        if (!(before[i].state == LinkState::kNear && before[i].lower_bound > 0.02)) continue;
        // A mesh with holes whose bound is within its interior gap proves nothing of other poses.
        const LinkModel& link = growing.stages[s]->robot()->links[i];
        if (!link.solid.is_closed()) continue;
        ++positive;
        EXPECT_GE(growing.results[i].lower_bound, before[i].lower_bound - 20.0 * kStep)
            << link.name << " at stage " << s;
      }
    }
  }
  EXPECT_GT(positive, 100);
}

// Links are there as soon as they are made, those with little work first; the last model is the
// same as one that is made at once.
TEST(AnytimeModel, LinksAreReadyOneGroupAfterTheOther) {
  const auto arm = demo();
  const RobotModelConfig config = config_to(kMaxError);
  std::vector<AnytimeModel::Ptr> parts;
  double reported = 0.0;
  RobotModelCallbacks callbacks;
  callbacks.progress = [&](const ModelProgress& progress) {
    EXPECT_GE(progress.fraction, reported - 1e-9);
    reported = progress.fraction;
  };
  const auto whole =
      AnytimeModel::build(arm, config, Stage::kFirst, callbacks,
                          [&](const AnytimeModel::Ptr& part) { parts.push_back(part); });
  const auto at_once = AnytimeModel::build(arm, config, Stage::kFirst);
  ASSERT_GE(parts.size(), 2U);
  EXPECT_NEAR(reported, 1.0, 1e-9);
  std::size_t pending = arm->links.size();
  for (std::size_t k = 0; k <= parts.size(); ++k) {
    const bool is_last = k == parts.size();
    const RobotModel& robot = *(is_last ? whole : parts[k])->robot();
    ASSERT_EQ(robot.links.size(), at_once->robot()->links.size());
    std::size_t left = 0;
    for (std::size_t i = 0; i < robot.links.size(); ++i) {
      const LinkModel &link = robot.links[i], &truth = at_once->robot()->links[i];
      EXPECT_EQ(link.name, truth.name);
      if (!is_pending(link)) EXPECT_EQ(link.error, truth.error);
      left += is_pending(link) ? 1 : 0;
      if (!link.usable()) continue;
      ASSERT_EQ(link.packing.spheres.size(), truth.packing.spheres.size()) << link.name;
      EXPECT_FALSE(link.solid.empty());
      EXPECT_FALSE(link.tree.empty());
      // What is made stays.
      if (!is_last) EXPECT_EQ(link.packing_id, whole->robot()->links[i].packing_id);
    }
    EXPECT_LT(left, pending);
    pending = left;
    if (!is_last) EXPECT_FALSE(same_geometry(robot, *whole->robot()));
  }
  EXPECT_EQ(pending, 0U);
}

}  // namespace
}  // namespace ist
