#include "ist_proximity/cloud/cloud_snapshot.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <thread>
#include <vector>

namespace ist {
namespace {

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
    if (std::vector<int>* waiting = channel.waiting()) waiting->assign(8, -1);  // nobody reads it
    channel.back().assign(static_cast<std::size_t>(1 + i % 64), i);
    channel.publish();
  }
  reader.join();
  EXPECT_FALSE(wrong);
}

}  // namespace
}  // namespace ist
