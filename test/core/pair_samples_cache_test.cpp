#include "internal/proximity/pair_samples_cache.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <set>
#include <string>
#include <vector>

#include "support/demo_arm.h"
#include "support/temp_dir.h"

namespace ist {
namespace {

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
  std::ifstream in(file(), std::ios::binary);
  const std::string good((std::istreambuf_iterator<char>(in)), {});
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
