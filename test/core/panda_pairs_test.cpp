// Sampled pairs of the Panda beside the SRDF that MoveIt publishes for it.

#include <gtest/gtest.h>

#include <fstream>
#include <set>
#include <string>
#include <vector>

#include "internal/proximity/pair_samples_cache.h"
#include "ist_proximity/proximity/self_query.h"
#include "support/accuracy.h"
#include "support/data_dir.h"
#include "support/demo_arm.h"
#include "support/sanitizers.h"
#include "support/temp_dir.h"
#include "support/truth.h"

namespace ist {
namespace {

using Names = std::set<std::string>;

// Facts from panda_moveit_config/config/panda.srdf of moveit/moveit_resources (commit 8c2f1ed): the
// pairs with reason "Never" and "Adjacent". A digit N stands for panda_linkN.
const Names kNever = {"0-2",    "0-3",     "0-4",     "1-3",     "1-4",    "2-4",
                      "2-6",    "3-5",     "3-6",     "3-7",     "4-6",    "4-7",
                      "3-hand", "4-hand",  "6-hand",  "3-left",  "4-left", "6-left",
                      "7-left", "3-right", "4-right", "6-right", "7-right"};
const Names kAdjacent = {"0-1", "1-2", "2-3",    "3-4",       "4-5",
                         "5-6", "6-7", "7-hand", "hand-left", "hand-right"};

std::string shortened(const std::string& link) {
  if (link == "panda_leftfinger") return "left";
  if (link == "panda_rightfinger") return "right";
  return link == "panda_hand" ? "hand" : link.substr(std::string("panda_link").size());
}

// The same pairs. In contact at rest are the fingers, which the SRDF disables as "Default", and two
// pairs that the SRDF watches: with all joints at zero the hand is folded into link 5.
TEST(PandaPairs, AreThoseOfThePublishedSrdf) {
  const auto data = test::data_dir();
  if (!data) GTEST_SKIP() << test::kNoData;
  if (test::kSanitized) GTEST_SKIP() << "takes minutes";
  const RobotDescription description = test::read_panda(*data, GeometrySource::kCollision);
  RobotModelConfig config;
  config.packing.max_error = 0.02;
  const auto model = build_robot_model(description, config);
  const Kinematics kinematics(description);
  const std::vector<bool> all(model->links.size(), true);
  const auto name = [&](const LinkPair& pair) {
    return shortened(model->links[pair.first].name) + "-" +
           shortened(model->links[pair.second].name);
  };
  const std::vector<LinkPair> pairs = self_collision_pairs(*model, kinematics, all, {});
  Names adjacent, never, always;
  for (std::size_t i = 0; i < all.size(); ++i) {
    for (std::size_t k = i + 1; k < all.size(); ++k) adjacent.insert(name({i, k}));
  }
  for (const LinkPair& pair : pairs) adjacent.erase(name(pair));
  EXPECT_EQ(adjacent, kAdjacent);
  for (const SampledPair& sampled : sample_pairs(model, kinematics, pairs, {})) {
    if (sampled.never()) never.insert(name(sampled.pair));
    if (sampled.always()) always.insert(name(sampled.pair));
  }
  EXPECT_EQ(never, kNever);
  EXPECT_EQ(always, Names());
  Names at_rest;
  for (const LinkPair& pair : in_contact_at_rest(model, kinematics, pairs)) {
    at_rest.insert(name(pair));
  }
  EXPECT_EQ(at_rest, (Names{"5-7", "5-hand", "left-right"}));
}

class PairSamplesCacheTest : public testing::Test {
 protected:
  PairSamplesCacheTest()
      : description_(test::demo_robot()),
        model_(test::demo_model()),
        kinematics_(description_),
        pairs_(self_collision_pairs(*model_, kinematics_,
                                    std::vector<bool>(model_->links.size(), true), {})) {
    sampling_.configurations = 20;
  }
  std::string key() const {
    return pair_samples_key(description_, *model_, kinematics_, pairs_, sampling_);
  }
  std::string file() const { return dir_.file(key() + ".istpairs"); }
  bool is_used(const std::string& bytes, std::string* warning) {
    std::ofstream(file(), std::ios::binary) << bytes;
    return PairSamplesCache(dir_.path().string()).load(key(), pairs_, warning).has_value();
  }

  test::TempDir dir_;
  RobotDescription description_;
  std::shared_ptr<const RobotModel> model_;
  Kinematics kinematics_;
  std::vector<LinkPair> pairs_;
  PairSampling sampling_;
};

TEST_F(PairSamplesCacheTest, keepsTheCounts) {
  const PairSamplesCache cache(dir_.path().string());
  std::string warning;
  EXPECT_FALSE(cache.load(key(), pairs_, &warning));
  const auto sampled = sample_pairs(model_, kinematics_, pairs_, sampling_);
  cache.store(key(), sampled, &warning);
  const auto kept = cache.load(key(), pairs_, &warning);
  EXPECT_EQ(warning, "");
  ASSERT_TRUE(kept);
  ASSERT_EQ(kept->size(), sampled.size());
  std::size_t measured = 0;
  for (std::size_t i = 0; i < sampled.size(); ++i) {
    EXPECT_EQ((*kept)[i].pair.first, sampled[i].pair.first);
    EXPECT_EQ((*kept)[i].pair.second, sampled[i].pair.second);
    EXPECT_EQ((*kept)[i].contacts, sampled[i].contacts);
    EXPECT_EQ((*kept)[i].measured, sampled[i].measured);
    measured += sampled[i].measured;
  }
  EXPECT_EQ(measured, 20 * pairs_.size());
}

// Whatever changes the result changes the key.
TEST_F(PairSamplesCacheTest, otherRobotsHaveOtherKeys) {
  std::set<std::string> keys = {key()};
  const auto is_new = [&] { return keys.insert(key()).second; };
  EXPECT_FALSE(is_new());
  sampling_.configurations = 21;
  EXPECT_TRUE(is_new());
  sampling_.seed = 2;
  EXPECT_TRUE(is_new());
  pairs_.pop_back();
  EXPECT_TRUE(is_new());
  description_.links[0].geometry[0].X_LE.translation().x() += 1e-6;
  EXPECT_TRUE(is_new());
  description_.links[0].geometry[0].shape = Sphere{0.1};
  EXPECT_TRUE(is_new());
  description_.joints[1].upper += 0.01;
  kinematics_ = Kinematics(description_);
  EXPECT_TRUE(is_new());
}

// Truncated, damaged and forged files count as absent, and one sentence says why.
TEST_F(PairSamplesCacheTest, damagedFilesAreNotUsed) {
  std::string warning;
  PairSamplesCache(dir_.path().string())
      .store(key(), sample_pairs(model_, kinematics_, pairs_, sampling_), &warning);
  const std::string good = test::read_text(file());
  ASSERT_TRUE(is_used(good, &warning));
  for (std::size_t size = 0; size < good.size(); size += 7) {
    EXPECT_FALSE(is_used(good.substr(0, size), &warning)) << size;
  }
  EXPECT_FALSE(is_used(good + "x", &warning));
  for (std::size_t i = 0; i < good.size(); ++i) {
    std::string bad = good;
    bad[i] = static_cast<char>(bad[i] ^ 1);
    EXPECT_FALSE(is_used(bad, &warning)) << i;
  }
  EXPECT_NE(warning.find(key()), std::string::npos);
  EXPECT_NE(warning.find("is not used: its checksum is wrong"), std::string::npos) << warning;
}

}  // namespace
}  // namespace ist
