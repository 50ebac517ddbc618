// Queries of organized clouds whose tiles are lazily loaded, by one and by several threads.

#include <gtest/gtest.h>

#include <limits>
#include <memory>
#include <thread>
#include <vector>

#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "support/meshes.h"
#include "support/oracle.h"
#include "support/scene.h"
#include "support/tiles.h"
#include "support/whole_cloud.h"

namespace ist {
namespace {

constexpr std::size_t kWidth = 96, kHeight = 80;

// A depth image of a wall, a board in front of it and some NaN pixels, as four floats a point.
std::shared_ptr<std::vector<float>> depth_image(test::Rng* rng) {
  auto pixels = std::make_shared<std::vector<float>>(4 * kWidth * kHeight);
  const double board = test::uniform(rng, 0.5, 0.7);
  for (std::size_t i = 0; i < kWidth * kHeight; ++i) {
    const double a = static_cast<double>(i % kWidth) / 60.0 - 0.8,
                 b = static_cast<double>(i / kWidth) / 60.0 - 0.7;
    const double depth = a > 0.1 && b < 0.2 ? board : 0.9 + 0.1 * a;
    const bool is_blind = (*rng)() % 300 == 0;
    (*pixels)[4 * i] =
        is_blind ? std::numeric_limits<float>::quiet_NaN() : static_cast<float>(a * depth);
    (*pixels)[4 * i + 1] = static_cast<float>(b * depth);
    (*pixels)[4 * i + 2] = static_cast<float>(depth);
  }
  return pixels;
}

RawCloud raw(const std::shared_ptr<std::vector<float>>& pixels) {
  RawCloud cloud = packed_cloud(pixels->data(), kWidth, kHeight, 4);
  cloud.owner = pixels;
  return cloud;
}

std::vector<Eigen::Vector3d> points_F(const std::vector<float>& pixels,
                                      const Eigen::Isometry3d& X_FS) {
  std::vector<Eigen::Vector3d> points;
  for (std::size_t i = 0; i < pixels.size(); i += 4) {
    const Eigen::Vector3f p(pixels[i], pixels[i + 1], pixels[i + 2]);
    if (p.allFinite()) points.push_back(X_FS * p.cast<double>());
  }
  return points;
}

const std::vector<TriangleMesh>& meshes() {
  static const std::vector<TriangleMesh> kMeshes = {
      test::l_shape(0.2, 0.05), test::icosphere(0.08, 2), test::box({0.05, 0.1, 0.2})};
  return kMeshes;
}

struct Scene {
  explicit Scene(test::Rng* rng) : X_FS(test::random_pose(rng, 0.5)), pixels(depth_image(rng)) {
    for (std::size_t i = 0; i < meshes().size(); ++i) {
      Eigen::Isometry3d X_SL = test::random_pose(rng, 0.25);
      X_SL.pretranslate(Eigen::Vector3d(0.0, 0.0, 0.5));
      X_FL.push_back(X_FS * X_SL);
    }
  }
  double truth(std::size_t link) const {
    std::vector<Eigen::Vector3d> points_L;
    for (const Eigen::Vector3d& p : points_F(*pixels, X_FS)) {
      points_L.push_back(X_FL[link].inverse() * p);
    }
    return test::oracle_minimum(meshes()[link], points_L);
  }
  std::vector<LinkProximity> answers(const CloudSnapshot& cloud) const {
    static const auto model = test::make_model({meshes().begin(), meshes().end()}, 0.005);
    QueryConfig config;
    config.max_distance = 5.0;
    config.tolerance = 0.0;
    std::vector<LinkProximity> links;
    EXPECT_TRUE(ProximityQuery(model, config).run(X_FL, {true, true, true}, {&cloud}, &links));
    return links;
  }

  Eigen::Isometry3d X_FS;
  std::shared_ptr<std::vector<float>> pixels;
  std::vector<Eigen::Isometry3d> X_FL;
};

class LazyTiles : public ::testing::Test {
 protected:
  void see(const Scene& scene) { ingest_.run(raw(scene.pixels), scene.X_FS, {}, 0.0, &cloud_); }

  Ingest ingest_{test::whole_cloud(false)};
  CloudSnapshot cloud_;
};

TEST_F(LazyTiles, AnswersAgainstBruteForce) {
  test::Rng rng(71);
  for (int i = 0; i < 12; ++i) {
    const Scene scene(&rng);
    see(scene);
    const std::vector<LinkProximity> links = scene.answers(cloud_);
    for (std::size_t k = 0; k < links.size(); ++k) {
      EXPECT_NEAR(links[k].distance, scene.truth(k), 2e-6) << "scene " << i << ", link " << k;
    }
  }
}

// All threads begin when no tile is loaded.
TEST_F(LazyTiles, ThreadsGetTheSameAnswers) {
  test::Rng rng(73);
  const Scene scene(&rng);
  std::vector<LinkProximity> first;
  for (int round = 0; round < 10; ++round) {
    cloud_ = CloudSnapshot();
    see(scene);
    std::vector<std::vector<LinkProximity>> answers(3);
    std::vector<std::thread> threads;
    for (std::vector<LinkProximity>& links : answers) {
      threads.emplace_back([&] { links = scene.answers(cloud_); });
    }
    for (std::thread& thread : threads) thread.join();
    if (first.empty()) first = answers[0];
    for (const std::vector<LinkProximity>& links : answers) {
      for (std::size_t i = 0; i < links.size(); ++i) {
        ASSERT_NEAR(links[i].distance, first[i].distance, 1e-12);
      }
    }
  }
}

// A copy does not need the message.
TEST_F(LazyTiles, CopyHoldsAllPoints) {
  test::Rng rng(75);
  const Scene scene(&rng);
  see(scene);
  const CloudSnapshot copy = cloud_;
  const std::vector<PointTile> tiles = test::tiles_of(cloud_.index);
  ASSERT_EQ(copy.index.bvh().tile_count(), tiles.size());
  EXPECT_EQ(copy.index.size(), cloud_.index.size());
  scene.pixels->assign(scene.pixels->size(), 0.0F);
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    PointTile scratch;
    ASSERT_TRUE(test::same_points(copy.index.bvh().tile(i, &scratch), tiles[i]));
  }
}

TEST_F(LazyTiles, SnapshotKeepsItsMessageUntilTheNextOne) {
  test::Rng rng(74);
  std::weak_ptr<std::vector<float>> message;
  {
    const Scene scene(&rng);
    message = scene.pixels;
    see(scene);
  }
  EXPECT_FALSE(message.expired());
  ingest_.run(RawCloud(), Eigen::Isometry3d::Identity(), {}, 0.0, &cloud_);
  EXPECT_TRUE(message.expired());
}

// One missing pixel in nearly every tile leaves few tiles to be read later: the message, which is
// as large as all tiles, is not kept for them. Answers are those of brute force, and the bytes may
// change.
TEST_F(LazyTiles, MessageIsNotKeptForFewTiles) {
  test::Rng rng(76);
  Scene scene(&rng);
  for (std::size_t tile = 0; tile < kWidth * kHeight / 16; ++tile) {
    if (tile % 48 < 2) continue;  // two whole ones side by side
    const std::size_t row = tile / (kWidth / 4) * 4, column = tile % (kWidth / 4) * 4;
    (*scene.pixels)[4 * ((row + rng() % 4) * kWidth + column + rng() % 4)] =
        std::numeric_limits<float>::quiet_NaN();
  }
  const std::weak_ptr<std::vector<float>> message = scene.pixels;
  CloudSnapshot loaded;
  RawCloud not_owned = raw(scene.pixels);
  not_owned.owner = nullptr;
  ingest_.run(not_owned, scene.X_FS, {}, 0.0, &loaded);
  see(scene);
  std::vector<double> truth;
  for (std::size_t k = 0; k < meshes().size(); ++k) truth.push_back(scene.truth(k));
  scene.pixels->assign(scene.pixels->size(), 0.0F);
  scene.pixels.reset();
  EXPECT_TRUE(message.expired());
  const std::vector<PointTile> expected = test::tiles_of(loaded.index);
  ASSERT_EQ(cloud_.index.bvh().tile_count(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) {
    PointTile scratch;
    ASSERT_TRUE(cloud_.index.bvh().is_loaded(i));
    ASSERT_TRUE(test::same_points(cloud_.index.bvh().tile(i, &scratch), expected[i]));
  }
  const std::vector<LinkProximity> links = scene.answers(cloud_);
  for (std::size_t k = 0; k < links.size(); ++k) EXPECT_NEAR(links[k].distance, truth[k], 2e-6);
}

TEST_F(LazyTiles, ClearedIndexLetsGoOfItsMessageAndIsEmpty) {
  test::Rng rng(77);
  Scene scene(&rng);
  const std::weak_ptr<std::vector<float>> message = scene.pixels;
  see(scene);
  const std::size_t memory = cloud_.index.memory();
  scene.pixels.reset();
  EXPECT_FALSE(message.expired());
  cloud_.index.clear();
  EXPECT_TRUE(message.expired());
  EXPECT_TRUE(cloud_.index.empty());
  EXPECT_EQ(cloud_.index.size(), 0U);
  EXPECT_EQ(cloud_.index.memory(), memory) << "kept for the next cloud";
  for (const LinkProximity& link : scene.answers(cloud_)) {
    EXPECT_EQ(link.state, LinkState::kClear);
  }
}

}  // namespace
}  // namespace ist
