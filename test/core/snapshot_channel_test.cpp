#include "ist_proximity/cloud/cloud_snapshot.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <set>
#include <thread>
#include <vector>

namespace ist {
namespace {

TEST(SnapshotChannel, nothingBeforeTheFirstPublish) {
  SnapshotChannel<int> channel;
  EXPECT_FALSE(channel.update());
  EXPECT_EQ(channel.front(), 0);
  channel.back() = 1;  // not published yet
  EXPECT_FALSE(channel.update());
  EXPECT_EQ(channel.front(), 0);
}

TEST(SnapshotChannel, updateTakesTheNewestOnce) {
  SnapshotChannel<int> channel;
  for (const int value : {1, 2, 3}) {
    channel.back() = value;
    channel.publish();
  }
  EXPECT_TRUE(channel.update());
  EXPECT_EQ(channel.front(), 3);
  EXPECT_FALSE(channel.update());
  EXPECT_EQ(channel.front(), 3) << "stays until the next update";
}

TEST(SnapshotChannel, frontIsNotTouchedByTheWriter) {
  SnapshotChannel<int> channel;
  channel.back() = 1;
  channel.publish();
  ASSERT_TRUE(channel.update());
  const int* front = &channel.front();
  for (int value = 2; value < 20; ++value) {
    EXPECT_NE(&channel.back(), front);
    channel.back() = value;
    channel.publish();
    EXPECT_EQ(*front, 1);
  }
}

TEST(SnapshotChannel, threeSlotsAreReused) {
  SnapshotChannel<int> channel;
  std::set<const int*> slots{&channel.front()};
  for (int i = 0; i < 20; ++i) {
    slots.insert(&channel.back());
    channel.publish();
    if (i % 3 == 0) channel.update();
    slots.insert(&channel.front());
  }
  EXPECT_EQ(slots.size(), 3U);
}

// A torn or stale value would break "all elements equal" or "never older than before". Run under
// ThreadSanitizer this also proves that the slots are handed over with the right memory order.
TEST(SnapshotChannel, twoThreads) {
  constexpr int kValues = 20000;
  SnapshotChannel<std::vector<int>> channel;
  std::atomic<bool> wrong{false};
  std::thread reader([&channel, &wrong] {
    int last = 0;
    while (last < kValues) {
      if (!channel.update()) {
        std::this_thread::yield();
        continue;
      }
      const std::vector<int>& value = channel.front();
      const bool whole = !value.empty() && value.front() > last &&
                         std::count(value.begin(), value.end(), value.front()) ==
                             static_cast<std::ptrdiff_t>(value.size());
      if (!whole) {
        wrong = true;
        return;
      }
      last = value.front();
    }
  });
  for (int i = 1; i <= kValues; ++i) {
    channel.back().assign(static_cast<std::size_t>(1 + i % 64), i);
    channel.publish();
  }
  reader.join();
  EXPECT_FALSE(wrong);
}

}  // namespace
}  // namespace ist
