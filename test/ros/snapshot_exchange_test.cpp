// How many snapshots a source needs, what old ones keep alive, and the messages that are received
// into again.

#include "ros/input/snapshot_exchange.h"

#include <gtest/gtest.h>
#include <sensor_msgs/PointCloud2.h>

#include <boost/weak_ptr.hpp>

#include <algorithm>
#include <memory>
#include <set>
#include <vector>

#include "ist_proximity/cloud/ingest.h"
#include "ros/input/receive_pool.h"

namespace ist {
namespace {

using Message = std::shared_ptr<std::vector<float>>;

// A wall of 64 x 64 points, of which the index reads tiles later.
Message fill(SourceSnapshot* snapshot) {
  constexpr std::size_t kSide = 64;
  auto message = std::make_shared<std::vector<float>>(4 * kSide * kSide, 1.0F);
  for (std::size_t i = 0; i < kSide * kSide; ++i) {
    (*message)[4 * i] = 0.01F * static_cast<float>(i % kSide);
    (*message)[4 * i + 1] = 0.01F * static_cast<float>((i - i % kSide) / kSide);
  }
  RawCloud cloud = packed_cloud(message->data(), kSide, kSide, 4);
  cloud.owner = message;
  Ingest(IngestConfig()).run(cloud, Eigen::Isometry3d::Identity(), {}, 0.0, &snapshot->cloud);
  return message;
}

TEST(SnapshotExchange, TwoSnapshotsWhileEachIsTakenBeforeTheNext) {
  SnapshotExchange exchange;
  std::set<const SourceSnapshot*> used;
  for (int i = 0; i < 20; ++i) {
    used.insert(&exchange.writable());
    exchange.publish();
    EXPECT_EQ(exchange.newest().get(), exchange.share().get());
  }
  EXPECT_EQ(used.size(), 2U);
}

TEST(SnapshotExchange, NewestIsNeverFilledAgain) {
  SnapshotExchange exchange;
  exchange.writable();
  exchange.publish();
  for (int i = 0; i < 50; ++i) {
    const SourceSnapshot* const front = exchange.newest().get();
    const auto shared = exchange.share();
    for (int late = 0; late <= i % 4; ++late) {
      SourceSnapshot& next = exchange.writable();
      ASSERT_NE(&next, front);
      ASSERT_NE(&next, shared.get()) << "a service holds it";
      exchange.release_unused();
      exchange.publish();
    }
  }
}

TEST(SnapshotExchange, OldSnapshotLetsGoOfItsMessageOnceTheNewestIsTaken) {
  SnapshotExchange exchange;
  std::weak_ptr<std::vector<float>> first = fill(&exchange.writable());
  exchange.publish();
  exchange.newest();
  const std::weak_ptr<std::vector<float>> second = fill(&exchange.writable());
  exchange.publish();
  EXPECT_FALSE(exchange.release_unused());
  EXPECT_FALSE(first.expired()) << "the cycle may read it until it takes the next";
  exchange.newest();
  EXPECT_TRUE(exchange.release_unused());
  EXPECT_TRUE(first.expired());
  EXPECT_FALSE(second.expired());
  EXPECT_FALSE(exchange.newest()->cloud.index.empty());
}

TEST(SnapshotExchange, SharedSnapshotKeepsItsMessage) {
  SnapshotExchange exchange;
  const std::weak_ptr<std::vector<float>> first = fill(&exchange.writable());
  exchange.publish();
  exchange.newest();
  auto held = exchange.share();
  fill(&exchange.writable());
  exchange.publish();
  exchange.newest();
  EXPECT_TRUE(exchange.release_unused());
  EXPECT_FALSE(first.expired());
  EXPECT_FALSE(held->cloud.index.empty());
  held.reset();
  EXPECT_TRUE(exchange.release_unused());
  EXPECT_TRUE(first.expired());
}

// A cycle that was late once makes a third snapshot necessary; it is freed when it was not needed
// for kSpareAge snapshots.
TEST(SnapshotExchange, SpareSnapshotIsFreedLater) {
  SnapshotExchange exchange;
  std::set<const SourceSnapshot*> used;
  const auto publish = [&] {
    used.insert(&exchange.writable());
    exchange.publish();
  };
  publish();
  exchange.newest();
  publish();
  publish();  // the second was not taken
  EXPECT_EQ(used.size(), 3U);
  std::vector<std::weak_ptr<const SourceSnapshot>> all;
  for (int i = 0; i < 2 * SnapshotExchange::kSpareAge; ++i) {
    exchange.newest();
    exchange.release_unused();
    publish();
    all.push_back(exchange.share());
  }
  exchange.newest();
  exchange.release_unused();
  std::set<const SourceSnapshot*> alive;
  for (const auto& snapshot : all) {
    if (const auto one = snapshot.lock()) alive.insert(one.get());
  }
  EXPECT_EQ(alive.size(), 2U);
}

TEST(ReceivePool, MemoryIsUsedAgainOnceNobodyHoldsIt) {
  ReceivePool<sensor_msgs::PointCloud2> pool;
  auto first = pool.take();
  first->data.resize(1000);
  const auto second = pool.take();
  EXPECT_NE(first, second);
  const std::uint8_t* const bytes = first->data.data();
  first.reset();
  const auto third = pool.take();
  EXPECT_EQ(third->data.data(), bytes);
}

TEST(ReceivePool, MemoryOfAHugeMessageIsNotKept) {
  ReceivePool<sensor_msgs::PointCloud2> pool;
  pool.take()->data.resize(100000);
  pool.take()->data.resize(1000);
  EXPECT_LE(pool.take()->data.capacity(), 1000U);
}

// Messages that have waited for transforms are used again as long as that goes on, and freed later.
TEST(ReceivePool, AsManyMessagesAreKeptAsWereHeldLately) {
  using Pool = ReceivePool<sensor_msgs::PointCloud2>;
  Pool pool;
  std::vector<Pool::Pointer> held;
  std::vector<boost::weak_ptr<sensor_msgs::PointCloud2>> all;
  const auto alive = [&] {
    return std::count_if(all.begin(), all.end(), [](const auto& one) { return !one.expired(); });
  };
  for (int i = 0; i < 10; ++i) {
    held.push_back(pool.take());
    held.back()->data.resize(1000);
    all.emplace_back(held.back());
  }
  held.clear();
  EXPECT_EQ(alive(), 10);
  for (unsigned i = 0; i < Pool::kWindow; ++i) pool.take()->data.resize(1000);
  EXPECT_EQ(alive(), 10) << "ten were held in this window";
  for (unsigned i = 0; i < 2 * Pool::kWindow; ++i) pool.take()->data.resize(1000);
  EXPECT_EQ(alive(), 1);
}

}  // namespace
}  // namespace ist
