#include "ros/poses/transform_buffer.h"

#include <gtest/gtest.h>

#include <atomic>
#include <boost/make_shared.hpp>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <thread>

#include "ros/poses/transforms.h"
#include "support/allocations.h"
#include "support/errors.h"

namespace ist {
namespace {

geometry_msgs::TransformStamped transform(const std::string& parent, const std::string& child,
                                          double stamp, double x = 0.0) {
  geometry_msgs::TransformStamped message;
  message.header.frame_id = parent;
  message.child_frame_id = child;
  message.header.stamp = ros::Time(stamp);
  message.transform.translation.x = x;
  message.transform.rotation.w = 1.0;
  return message;
}

struct TransformBufferTest : ::testing::Test {
  TransformBuffer buffer{ros::Duration(10.0)};
};

TEST_F(TransformBufferTest, refusesWithTheReason) {
  const ros::Time now(100.0);
  EXPECT_EQ(buffer.add(transform("world", "base", 99.9), "/a", false, now), "");
  EXPECT_EQ(buffer.why_refused("world", "hand"), "");

  geometry_msgs::TransformStamped bad = transform("base", "arm", 99.9);
  bad.transform.translation.y = std::numeric_limits<double>::quiet_NaN();
  test::expect_says(buffer.add(bad, "/a", false, now), "NaN or infinity");
  bad = transform("base", "arm", 99.9);
  bad.transform.rotation.w = 0.9;
  test::expect_says(buffer.add(bad, "/a", false, now), "length 0.9");
  test::expect_says(buffer.add(transform("base", "arm", 0.0), "/a", false, now), "no stamp");
  test::expect_says(buffer.add(transform("base", "arm", 101.5), "/a", false, now),
                    "1.50 s in the f");
  test::expect_says(buffer.add(transform("base", "base", 99.9), "/a", false, now), "itself");
  test::expect_says(buffer.add(transform("", "arm", 99.9), "/a", false, now), "no frame");
  test::expect_says(buffer.add(transform("world", "base", 80.0), "/a", false, now),
                    "19.90 s behind");
  // The reason is found for what hangs on the frame, although it has never had a pose.
  EXPECT_EQ(buffer.add(transform("arm", "hand", 99.9), "/a", false, now), "");
  bad = transform("base", "arm", 99.95);
  bad.transform.rotation.w = 0.9;
  buffer.add(bad, "/a", false, now);
  test::expect_says(buffer.why_refused("world", "hand"), "from 'arm' to 'base'");
  EXPECT_EQ(buffer.why_refused("arm", "hand"), "");
}

// Where good transforms come beside them, refused ones were in the log alone.
TEST_F(TransformBufferTest, twoGoodTransformsOfItsPublisherEndARefusal) {
  double t = 100.0;
  const auto send = [&](const char* publisher, double ahead) {
    t += 0.01;
    return buffer.add(transform("base", "arm", t + ahead), publisher, false, ros::Time(t)).empty();
  };
  EXPECT_FALSE(send("/b", 2.0));
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(send("/a", 0.0));
  test::expect_says(buffer.why_refused("base", "arm"), "of /b is stamped 2.00 s in the future");
  EXPECT_EQ(buffer.why_refused("base", "base"), "");
  EXPECT_TRUE(send("/b", 0.0));
  EXPECT_FALSE(send("/b", 2.0));
  EXPECT_TRUE(send("/b", 0.0));
  test::expect_says(doubt_of_pose(buffer, "base", "arm"), "of /b");
  EXPECT_TRUE(send("/b", 0.0));
  EXPECT_EQ(doubt_of_pose(buffer, "base", "arm"), "");
}

// A static transform is sent once. Its reason was forgotten a second after it was refused, and then
// the status named the publisher as dead.
TEST_F(TransformBufferTest, refusalsOfStaticTransformsStay) {
  const ros::Time now(100.0);
  EXPECT_EQ(buffer.add(transform("world", "base", 99.9), "/a", false, now), "");
  geometry_msgs::TransformStamped bad = transform("base", "camera", 0.0);
  bad.transform.rotation.w = 0.9;
  EXPECT_NE(buffer.add(bad, "/a", true, now), "");
  geometry_msgs::TransformStamped moving = transform("base", "arm", 99.9);
  moving.transform.rotation.w = 0.9;
  EXPECT_NE(buffer.add(moving, "/a", false, now), "");
  std::this_thread::sleep_for(std::chrono::milliseconds(1100));
  EXPECT_EQ(buffer.why_refused("world", "arm"), "");
  test::expect_says(buffer.why_refused("world", "camera"), "from 'camera' to 'base'");
  test::expect_says(buffer.problem(), "length 0.9");
  // A jump of the clock does not make it valid, and transforms of the new time are taken.
  buffer.clear();
  EXPECT_NE(buffer.why_refused("world", "camera"), "");
  EXPECT_EQ(buffer.add(transform("world", "base", 9.9), "/a", false, ros::Time(10.0)), "");
  // A good one ends it.
  EXPECT_EQ(buffer.add(transform("base", "camera", 0.0), "/a", true, ros::Time(10.0)), "");
  EXPECT_EQ(buffer.why_refused("world", "camera"), "");
  EXPECT_EQ(buffer.problem(), "");
}

TEST_F(TransformBufferTest, agesCountFromReceipt) {
  buffer.add(transform("world", "base", 99.99), "/a", false, ros::Time(100.0));
  EXPECT_EQ(buffer.counts_from("world", "arm", ros::Time(99.99)), ros::Time(99.99));
  EXPECT_EQ(buffer.ahead(), "");
  buffer.add(transform("base", "arm", 100.8), "/b", false, ros::Time(100.0));
  buffer.add(transform("arm", "hand", 100.81), "/a", false, ros::Time(100.81));
  test::expect_says(buffer.ahead(), "'arm' to 'base' is stamped 0.800 s ahead");
  EXPECT_EQ(buffer.counts_from("base", "hand", ros::Time(100.8)), ros::Time(100.0));
  EXPECT_EQ(buffer.counts_from("hand", "base", ros::Time(100.8)), ros::Time(100.0));
  // Transforms that are not between the two frames do not matter.
  EXPECT_EQ(buffer.counts_from("arm", "hand", ros::Time(100.81)), ros::Time(100.81));
  EXPECT_EQ(buffer.counts_from("world", "base", ros::Time(99.99)), ros::Time(99.99));
}

// A frame of which nobody knows yet how it moves may be anywhere by now.
TEST_F(TransformBufferTest, placesALateFrameWhenItsMotionIsKnown) {
  Lag lag;
  Eigen::Isometry3d X_FT;
  for (int i = 0; i < 8; ++i) {
    const double t = 100.0 + 0.05 * i;
    EXPECT_EQ(buffer.add(transform("base", "part", t, t), "/a", false, ros::Time(t)), "");
    EXPECT_EQ(look_up_near(buffer, "base", "part", ros::Time(t), 0.5, &X_FT, &lag), "");
    const std::string problem =
        look_up_near(buffer, "base", "part", ros::Time(t + 0.22), 0.5, &X_FT, &lag);
    EXPECT_EQ(problem.empty(), i > 4) << problem;
    EXPECT_EQ(problem.find("'part' is 0.22 s old") != std::string::npos, i <= 4) << problem;
  }
}

// A late frame is looked up in every cycle.
TEST_F(TransformBufferTest, tellsHowALateFrameMovedWithoutAllocationsOfItsOwn) {
  for (int i = 0; i < 20; ++i) {  // 0.2 m/s
    const double t = 100.0 + 0.05 * i;
    EXPECT_EQ(buffer.add(transform("base", "part", t, 0.2 * t), "/a", false, ros::Time(t)), "");
  }
  Lag lag;
  Eigen::Isometry3d X_FT;
  const auto allocations_of = [](const auto& function) {
    const long before = test::allocations;
    function();
    return test::allocations - before;
  };
  const long of_tf = allocations_of([&] {  // tf lists the transforms on the way to the newest
    look_up(buffer, "base", "part", ros::Time(), &X_FT);
  });
  for (const double late : {0.15, 0.05}) {
    const ros::Time time(100.95 + late);
    for (int i = 0; i < 3; ++i) {
      std::string problem;
      EXPECT_EQ(of_tf, allocations_of([&] {
                  problem = look_up_near(buffer, "base", "part", time, 0.5, &X_FT, &lag);
                }));
      ASSERT_EQ(problem, "");
    }
    EXPECT_EQ(lag.frame, "part");
    EXPECT_NEAR(lag.age, late, 1e-6);
    EXPECT_NEAR(X_FT.translation().x(), 0.2 * 100.95, 1e-9);
    ASSERT_EQ(lag.moves().size(), Lag::kMostWindows);
    for (const Eigen::Isometry3d& moved : lag.moves()) {
      EXPECT_NEAR(moved.translation().x(), 0.2 * lag.window, 1e-6);
    }
  }
  EXPECT_EQ(look_up_near(buffer, "base", "part", ros::Time(100.5), 0.5, &X_FT, &lag), "");
  EXPECT_TRUE(lag.moves().empty()) << "it is not late";
}

TEST_F(TransformBufferTest, namesDisagreeingPublishers) {
  for (int i = 0; i < 5; ++i) {
    const double t = 100.0 + 0.02 * i;
    buffer.add(transform("base", "arm", t, 0.1 * i), "/a", false, ros::Time(t));
    buffer.add(transform("base", "arm", t + 0.01, 0.1 * i + 0.05), "/same", false, ros::Time(t));
  }
  EXPECT_EQ(buffer.dispute("base", "arm"), "") << "they state one motion";
  for (int i = 0; i < 3; ++i) {
    const double t = 101.0 + 0.02 * i;
    buffer.add(transform("base", "arm", t, 0.5), "/a", false, ros::Time(t));
    buffer.add(transform("base", "arm", t + 0.01, 0.8), "/other", false, ros::Time(t));
  }
  const std::string text = buffer.dispute("base", "arm");
  test::expect_says(text, "/other");
  test::expect_says(text, "0.300 m apart");
  EXPECT_EQ(buffer.dispute("world", "base"), "");
}

// Whoever states a frame, and however: two that differ by more than rounding are named.
TEST(TransformBuffer, namesDisagreeingStatics) {
  struct Case {
    const char* what;
    bool first_is_static, second_is_static;
    const char* parent;  // of the second
    double x;            // [m] of the second; the first says 0
    const char* words;   // empty: they agree
  };
  for (const Case& c : {Case{"both static", true, true, "base", 0.1, "0.100 m apart"},
                        Case{"dynamic after static", true, false, "base", 0.1, "0.100 m apart"},
                        Case{"static after dynamic", false, true, "base", 0.002, "0.002 m apart"},
                        Case{"parents", true, true, "arm", 0.0, "is 'base' or 'arm'"},
                        Case{"dynamic parents", false, false, "arm", 0.0, "is 'base' or 'arm'"},
                        Case{"rounding", true, true, "base", 0.0005, ""},
                        Case{"rounding of a dynamic one", true, false, "/base", 0.0005, ""}}) {
    SCOPED_TRACE(c.what);
    TransformBuffer buffer(ros::Duration(10.0));
    const ros::Time now(100.0);
    buffer.add(transform("world", "base", 0.0), "/urdf", true, now);
    buffer.add(transform("base", "arm", 0.0), "/urdf", true, now);
    buffer.add(transform("base", "camera", 99.9), "/urdf", c.first_is_static, now);
    buffer.add(transform(c.parent, "camera", 99.95, c.x), "/driver", c.second_is_static, now);
    const std::string text = buffer.dispute("world", "camera");
    EXPECT_EQ(text.empty(), *c.words == 0) << text;
    test::expect_says(text, c.words);
    if (*c.words == 0) continue;
    test::expect_says(text, "/urdf and /driver");
    test::expect_says(text, "since 100.0 s");
    EXPECT_EQ(buffer.dispute("world", "arm"), "");
    // One that takes back what it said ends it.
    buffer.add(transform("base", "camera", 99.96), "/driver", c.second_is_static, now);
    EXPECT_EQ(buffer.dispute("world", "camera"), "");
  }
}

// A node that is gone disputes nothing, and the one that is left counts.
TEST_F(TransformBufferTest, disputesEndWithTheirPublisher) {
  auto first = boost::make_shared<ros::M_string>(), second = boost::make_shared<ros::M_string>();
  ros::Time now(100.0);
  const auto x_of = [&](const char* frame) {
    return buffer.lookupTransform("base", frame, ros::Time()).transform.translation.x;
  };
  buffer.add(transform("base", "camera", 0.0, 0.1), {"/a", first}, true, now);
  buffer.add(transform("base", "camera", 0.0, 0.2), {"/b", second}, true, now);
  buffer.end_disputes(now);
  EXPECT_NE(buffer.dispute("base", "camera"), "");
  second.reset();
  buffer.end_disputes(now);
  EXPECT_EQ(buffer.dispute("base", "camera"), "");
  EXPECT_EQ(x_of("camera"), 0.1);
  // It has come back under another name, with another calibration, after the first one went.
  first.reset();
  const auto third = boost::make_shared<ros::M_string>();
  buffer.add(transform("base", "camera", 0.0, 0.3), {"/c", third}, true, now);
  EXPECT_EQ(buffer.dispute("base", "camera"), "");
  EXPECT_EQ(x_of("camera"), 0.3);
  // It corrects itself.
  buffer.add(transform("base", "camera", 0.0, 0.4), {"/c", third}, true, now);
  EXPECT_EQ(buffer.dispute("base", "camera"), "");
  // A dynamic one that falls silent leaves the static one.
  for (int i = 0; i < 10; ++i) {
    now += ros::Duration(0.1);
    buffer.add(transform("base", "camera", now.toSec(), 0.5), "/d", false, now);
    EXPECT_NE(buffer.dispute("base", "camera"), "");
  }
  now += ros::Duration(0.9);
  buffer.end_disputes(now);
  EXPECT_NE(buffer.dispute("base", "camera"), "");
  now += ros::Duration(0.2);
  buffer.end_disputes(now);
  EXPECT_EQ(buffer.dispute("base", "camera"), "");
  EXPECT_EQ(x_of("camera"), 0.4);
  // The URDF's own numbers are compared with a transform that is not used.
  buffer.add(transform("base", "tool", 0.0, 0.1), "the URDF", true, now);
  buffer.compare(transform("base", "tool", 0.0, 0.2), "/driver", now);
  test::expect_says(buffer.dispute("base", "tool"), "the URDF and /driver");
  EXPECT_EQ(x_of("tool"), 0.1);
  buffer.withdraw("the URDF");
  buffer.end_disputes(now);
  EXPECT_EQ(buffer.dispute("base", "tool"), "");
}

// tf2 keeps what was static without time, so that its last pose would never be old.
TEST_F(TransformBufferTest, distrustsStaticTransformsThatMove) {
  auto first = boost::make_shared<ros::M_string>();
  const auto second = boost::make_shared<ros::M_string>();
  const ros::Time now(100.0);
  buffer.add(transform("base", "camera", 0.0, 0.1), {"/a", first}, true, now);
  buffer.add(transform("camera", "optical", 0.0), {"/a", first}, true, now);
  first.reset();
  buffer.add(transform("base", "camera", 100.0, 0.1), {"/b", second}, false, now);
  test::expect_says(buffer.dispute("base", "optical"), "/b moves it now");
  buffer.clear();
  EXPECT_NE(buffer.dispute("base", "optical"), "");
  buffer.add(transform("base", "camera", 0.0, 0.2), {"/b", second}, true, now);
  EXPECT_EQ(buffer.dispute("base", "optical"), "");

  // A joint that was fixed until the URDF was read again.
  buffer.add(transform("base", "slide", 0.0), "the URDF", true, now);
  buffer.withdraw("the URDF");
  buffer.add(transform("base", "slide", 100.0, 0.1), "/robot", false, now);
  test::expect_says(buffer.dispute("base", "slide"), "/robot moves it now");
}

// A slow publisher beside a fast one, three publishers, and clocks that differ.
TEST_F(TransformBufferTest, disputesDoNotFlicker) {
  bool is_disputed = false;
  for (int i = 0; i < 1000; ++i) {
    const ros::Time now(100.0 + 0.01 * i);
    buffer.add(transform("base", "arm", now.toSec(), 0.1), "/fast", false, now);
    if (i % 200 == 100) buffer.add(transform("base", "arm", now.toSec(), 0.2), "/slow", false, now);
    buffer.end_disputes(now);
    if (is_disputed) {
      ASSERT_NE(buffer.dispute("base", "arm"), "") << i;
    }
    is_disputed = is_disputed || !buffer.dispute("base", "arm").empty();
  }
  EXPECT_TRUE(is_disputed);

  TransformBuffer three(ros::Duration(10.0)), skewed(ros::Duration(10.0));
  const auto add = [](TransformBuffer* to, const char* publisher, double stamp, double x) {
    EXPECT_EQ(to->add(transform("base", "arm", stamp, x), publisher, false, ros::Time(stamp)), "");
    return !to->dispute("base", "arm").empty();
  };
  for (int i = 0; i < 100; ++i) {
    const double t = 100.0 + 0.02 * i;
    add(&three, "/a", t, 0.0);
    add(&three, "/b", t + 0.005, 0.0);
    EXPECT_EQ(add(&three, "/c", t + 0.01, 0.1), i > 0);
    add(&skewed, "/late", t, 0.0);
    EXPECT_EQ(add(&skewed, "/ahead", t + 0.495, 0.1), i >= 25) << i;
  }
}

// One publisher never disagrees with itself, and one that takes over does not either.
TEST_F(TransformBufferTest, onePublisherAfterAnotherIsNoDispute) {
  const auto add = [&](const char* publisher, geometry_msgs::TransformStamped message) {
    EXPECT_EQ(buffer.add(message, publisher, false, message.header.stamp), "");
    return buffer.dispute("base", message.child_frame_id);
  };
  for (int i = 0; i < 100; ++i) {
    EXPECT_EQ(add("/a", transform("base", "arm", 100.0 + 0.01 * i, i % 2)), "");
  }
  double x = 0.0;
  for (int i = 0; i < 100; ++i) {
    x = 5.0 + std::sin(i);
    EXPECT_EQ(add("/b", transform("base", "arm", 101.5 + 0.01 * i, x)), "");
  }
  // The same stamp, and other values.
  test::expect_says(add("/c", transform("base", "arm", 101.5 + 0.99, x + 0.02)), "/b and /c");
  // A quaternion and its negative agree.
  geometry_msgs::TransformStamped turned = transform("base", "hand", 100.0);
  EXPECT_EQ(add("/a", turned), "");
  turned.transform.rotation.w = -1.0;
  EXPECT_EQ(add("/b", turned), "");
}

// tf2 interpolates over any time. Where a publisher was silent for long, a frame that is elsewhere
// afterwards may have been anywhere in between.
TEST(TransformBuffer, inGapsOfWhatHasMovedNoPoseIsKnown) {
  TransformBuffer buffer(ros::Duration(10.0), 0.5);
  const auto connection = boost::make_shared<ros::M_string>();
  const TransformPublisher a("/a", connection);
  const auto add = [&](double stamp, double x) {
    EXPECT_EQ(buffer.add(transform("base", "arm", stamp, x), a, false, ros::Time(stamp)), "");
    EXPECT_EQ(buffer.add(transform("arm", "hand", stamp), a, false, ros::Time(stamp)), "");
  };
  Eigen::Isometry3d X;
  const auto problem = [&](double time, const char* frame = "hand") {
    std::string why;
    const std::string found = look_up(buffer, "base", frame, ros::Time(time), &X);
    EXPECT_EQ(is_known(buffer, "base", frame, ros::Time(time), &why), found.empty());
    EXPECT_EQ(why, found);
    return found;
  };
  for (int i = 0; i <= 4; ++i) add(100.0 + 0.4 * i, i);  // it moves, and is never silent for long
  EXPECT_EQ(problem(101.0), "");
  add(103.0, 4.0005);  // 1.4 s, in which it stands still
  EXPECT_EQ(problem(102.0), "");
  add(104.0, 5.0);
  test::expect_says(problem(103.5), "one to 'base' was silent for 1.00 s");
  EXPECT_EQ(problem(103.0), "");
  EXPECT_EQ(problem(104.0), "");
  EXPECT_EQ(look_up(buffer, "arm", "hand", ros::Time(103.5), &X), "");

  // What is newest of two frames may be in the gap of one.
  buffer.add(transform("base", "camera", 103.9), "/b", false, ros::Time(104.0));
  EXPECT_NE(look_up(buffer, "camera", "hand", ros::Time(), &X), "");
  buffer.add(transform("base", "camera", 104.1), "/b", false, ros::Time(104.1));
  EXPECT_EQ(look_up(buffer, "camera", "hand", ros::Time(), &X), "");

  add(103.6, 4.9);  // late
  EXPECT_NE(problem(103.5), "");
  EXPECT_EQ(problem(103.8), "");
  add(103.3, 4.5);
  EXPECT_EQ(problem(103.5), "");

  add(102.2, 7.0);  // it was elsewhere where it seemed to have stood
  EXPECT_NE(problem(102.0), "");
  EXPECT_NE(problem(102.6), "");
  EXPECT_EQ(problem(102.2), "");

  add(106.0, 9.0);
  EXPECT_NE(problem(105.0), "");

  // A frame of the same pose in another parent is elsewhere.
  buffer.add(transform("hand", "camera", 106.0), a, false, ros::Time(106.0));
  EXPECT_EQ(problem(106.0, "camera"), "");
  test::expect_says(problem(105.5, "camera"), "one to 'hand' was silent for 1.90 s");

  buffer.clear();  // the clock has jumped back
  add(95.0, 0.0);
  add(95.4, 1.0);
  EXPECT_EQ(problem(95.2), "");
}

// A cloud that was placed by the old transform was counted as placed by the new one.
TEST_F(TransformBufferTest, aPoseIsNotOlderThanTheStaticChangesCountedBefore) {
  const ros::Time now(100.0);
  ASSERT_EQ(buffer.add(transform("world", "camera", 0.0), "/a", true, now), "");
  std::atomic<int> begun{0}, ended{0};
  constexpr int kTimes = 20000;
  double x = 0.0;
  std::uint64_t changes = 0;
  std::thread placing([&] {
    for (int k = 1; k <= kTimes; ++k) {
      while (begun < k) std::this_thread::yield();
      for (volatile int wait = 0; wait < (k * 37) % 3000;) wait = wait + 1;
      changes = buffer.static_changes();
      Eigen::Isometry3d X;
      EXPECT_EQ(look_up(buffer, "world", "camera", now, &X), "");
      x = X.translation().x();
      ended = k;
    }
  });
  int old = 0, missed = 0;
  for (int k = 1; k <= kTimes; ++k) {
    begun = k;
    buffer.add(transform("world", "camera", 0.0, k % 2), "/a", true, now);
    while (ended < k) std::this_thread::yield();
    if (x == k % 2) continue;
    ++old;
    if (!buffer.has_static_change("world", "camera", changes)) ++missed;
  }
  placing.join();
  EXPECT_EQ(missed, 0) << "of " << old;
}

}  // namespace
}  // namespace ist
