#include "ros/common/lifetime.h"

#include <gtest/gtest.h>

namespace ist {
namespace {

TEST(Lifetime, DoesNotBeginAgainWhenTheClockGoesBack) {
  Lifetime ended(5.0, ros::Time(10.0));
  EXPECT_FALSE(ended.is_over(ros::Time(14.0)));
  EXPECT_TRUE(ended.is_over(ros::Time(15.0)));
  EXPECT_TRUE(ended.is_over(ros::Time(12.0)));
  ended.begin(5.0, ros::Time(12.0));
  EXPECT_FALSE(ended.is_over(ros::Time(13.0)));
  // From before its begin the clock comes back to it.
  EXPECT_TRUE(ended.is_over(ros::Time(2.0)));
  EXPECT_TRUE(ended.is_over(ros::Time(13.0)));
}

TEST(Lifetime, OfAnotherThreadsClockGoesOn) {
  const Lifetime just_set(5.0, ros::Time(10.0));
  just_set.is_over(ros::Time(9.999));
  EXPECT_FALSE(just_set.is_over(ros::Time(10.0)));
  const Lifetime endless(0.0, ros::Time(10.0));
  EXPECT_FALSE(endless.is_over(ros::Time(2.0)));
}

}  // namespace
}  // namespace ist
