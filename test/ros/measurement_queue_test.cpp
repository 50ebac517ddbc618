#include "ros/input/measurement_queue.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <vector>

namespace ist {
namespace {

constexpr double kStart = 1000.0;  // [s]

// A measurement with a stamp `after` seconds from the start.
std::shared_ptr<const Measurement> stub(double after, std::size_t bytes = 1) {
  const ros::Time stamp(kStart + after);
  ros::Time::init();
  ros::Time::setNow(stamp);
  auto measurement = std::make_shared<Measurement>();
  measurement->header.stamp = stamp;
  measurement->bytes = bytes;
  return measurement;
}

std::vector<double> stamps(const MeasurementQueue& queue) {
  std::vector<double> all;
  for (std::size_t i = 0; i < queue.size(); ++i) {
    all.push_back(queue[i].header.stamp.toSec() - kStart);
  }
  return all;
}

// How often a measurement was ready, and the longest time between two that were used, where they
// come at `rate` for ten seconds and their transforms `late` seconds after them.
struct Outcome {
  int used = 0, asked = 0;
  double longest = 0.0;
};

Outcome run(double rate, double late, std::size_t bytes) {
  MeasurementQueue queue;
  Outcome outcome;
  double last = late;
  for (int i = 0; i < static_cast<int>(10.0 * rate); ++i) {
    const double now = i / rate;
    queue.add(stub(now, bytes));
    queue.drop_overdue(ros::Time(kStart + now), 1.0);
    const std::size_t ready = queue.newest_ready([&](const Measurement& measurement) {
      ++outcome.asked;
      return measurement.header.stamp.toSec() - kStart <= now - late + 1e-6;
    });
    if (ready == queue.size()) continue;
    ++outcome.used;
    outcome.longest = std::max(outcome.longest, now - last);
    last = now;
    queue.drop_until(ready);
  }
  return outcome;
}

// Ten clouds could wait, so that at 30 Hz none was ever used whose transforms came 0.33 s later.
TEST(MeasurementQueue, isLongEnoughForLateTransforms) {
  for (const double late : {0.02, 0.3, 0.34, 0.5, 0.9}) {
    const Outcome outcome = run(30.0, late, 10 << 20);
    EXPECT_GT(outcome.used, 30.0 * (9.5 - late)) << late << " s";
    EXPECT_LT(outcome.longest, 0.1) << late << " s";
  }
}

// Large clouds that do not fit for as long are used less often, but they are.
TEST(MeasurementQueue, usesFewerWhereMemoryIsFull) {
  const Outcome outcome = run(30.0, 0.9, 60 << 20);  // five clouds fit
  EXPECT_GT(outcome.used, 30);
  EXPECT_LT(outcome.longest, 0.5);
}

TEST(MeasurementQueue, asksAboutFew) {
  const Outcome outcome = run(300.0, 0.9, 1000);
  EXPECT_GT(outcome.used, 2700);
  EXPECT_LT(outcome.asked, 3000 * 20);  // 270 wait
}

TEST(MeasurementQueue, keepsToItsMemory) {
  MeasurementQueue queue(100);
  std::size_t dropped = 0;
  for (int i = 0; i <= 32; ++i) {
    dropped += queue.add(stub(0.1 * i, 20));
    ASSERT_LE(queue.size(), 5U);
  }
  EXPECT_EQ(dropped, 28U);
  const std::vector<double> kept = stamps(queue);
  EXPECT_EQ(kept.front(), 0.0);
  EXPECT_NEAR(kept.back(), 3.2, 1e-6);
  for (std::size_t i = 1; i < kept.size(); ++i) EXPECT_LE(kept[i] - kept[i - 1], 1.7) << i;
  queue.add(stub(5.0, 1000));  // one that is larger than all memory is alone
  EXPECT_EQ(queue.size(), 1U);
  for (int i = 0; i < 3000; ++i) queue.add(stub(6.0 + 0.001 * i, 0));
  EXPECT_LE(queue.size(), MeasurementQueue::kMaxCount);
}

TEST(MeasurementQueue, isInTheOrderOfStamps) {
  MeasurementQueue queue;
  for (const double after : {0.3, 0.1, 0.2, 0.0}) queue.add(stub(after));
  EXPECT_TRUE(queue.newest().header.stamp == ros::Time(kStart + 0.3));
  queue.drop_until(1);
  ASSERT_EQ(queue.size(), 2U);
  EXPECT_NEAR(stamps(queue)[0], 0.2, 1e-6);
}

// A timeout of .inf does not keep what tf has forgotten.
TEST(MeasurementQueue, dropsWhatHasWaitedTooLong) {
  MeasurementQueue queue;
  for (int i = 0; i < 20; ++i) queue.add(stub(i));
  EXPECT_EQ(queue.drop_overdue(ros::Time(kStart + 20.0), INFINITY), 10U);
  EXPECT_EQ(queue.drop_overdue(ros::Time(kStart + 20.0), 4.5), 6U);
  EXPECT_EQ(queue.size(), 4U);
}

TEST(MeasurementQueue, findsTheNewestThatIsReady) {
  for (int size = 1; size < 40; ++size) {
    MeasurementQueue queue;
    for (int i = 0; i < size; ++i) queue.add(stub(i));
    for (int count = 0; count <= size; ++count) {
      const std::size_t found = queue.newest_ready([&](const Measurement& measurement) {
        return measurement.header.stamp < ros::Time(kStart + count);
      });
      EXPECT_EQ(found, static_cast<std::size_t>(count > 0 ? count - 1 : size)) << "of " << size;
    }
  }
}

}  // namespace
}  // namespace ist
