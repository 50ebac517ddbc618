// The deadline of a cycle: what the parameter means, the period that it is a share of, and what the
// status says when it passes.

#include <gtest/gtest.h>
#include <ist_proximity/ProximityArray.h>

#include <chrono>
#include <string>
#include <vector>

#include "ros/parameters/parameters.h"
#include "ros/poses/usual_period.h"
#include "ros/status/status.h"
#include "support/errors.h"

namespace ist {
namespace {

using Clock = std::chrono::steady_clock;

Clock::time_point at(double seconds) {
  return Clock::time_point() +
         std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
}

TEST(CycleDeadline, IsAShareOfThePeriodByDefault) {
  std::vector<std::string> warnings;
  const ServerConfig config = parse_parameters(XmlRpc::XmlRpcValue(), &warnings);
  EXPECT_EQ(config.query.deadline, kDefaultDeadline);
  EXPECT_EQ(LiveConfig().query.deadline, kDefaultDeadline);
  EXPECT_DOUBLE_EQ(deadline_of(config.query.deadline, 0.01), 0.0075);
  EXPECT_DOUBLE_EQ(deadline_of(-1.0, 0.01), 0.01);
  EXPECT_DOUBLE_EQ(deadline_of(0.002, 0.01), 0.002);
  EXPECT_EQ(deadline_of(0.0, 0.01), 0.0);
}

TEST(CycleDeadline, MayNotBeLongerThanThePeriodAsAShareOfIt) {
  for (const double wrong : {-1.5, 11.0}) {
    XmlRpc::XmlRpcValue tree;
    tree["query"]["deadline"] = wrong;
    std::vector<std::string> warnings;
    EXPECT_THROW(parse_parameters(tree, &warnings), ParameterError) << wrong;
  }
}

// TCP may deliver four messages at once: what counts is how many come in the mean.
TEST(CycleDeadline, UsualPeriodIsTheMeanOfBurstsToo) {
  for (const double period : {0.001, 0.02}) {
    UsualPeriod even(0.1), bursts(0.1);
    for (int i = 0; i < 1000; ++i) {
      even.note(at(period * i));
      bursts.note(at(period * 4 * (i / 4) + 1e-6 * (i % 4)));
    }
    EXPECT_NEAR(even.seconds(), period, 1e-9);
    EXPECT_NEAR(bursts.seconds(), period, 0.2 * period);
  }
}

TEST(CycleDeadline, UsualPeriodFollowsARateThatChanges) {
  UsualPeriod usual(0.1);
  EXPECT_EQ(usual.seconds(), 0.1);
  double now = 0.0;
  // A first burst says nothing of the rate.
  for (int i = 0; i < 10; ++i) usual.note(at(now += 1e-6));
  EXPECT_EQ(usual.seconds(), 0.1);
  for (int i = 0; i < 500; ++i) usual.note(at(now += 0.001));
  EXPECT_NEAR(usual.seconds(), 0.001, 1e-4);
  for (int i = 0; i < 500; ++i) usual.note(at(now += 0.02));
  EXPECT_NEAR(usual.seconds(), 0.02, 1e-3);
  // A long pause is one late message, not a slower rate.
  usual.note(at(now += 100.0));
  EXPECT_LT(usual.seconds(), 0.022);
}

TEST(CycleDeadline, StatusSaysWhatItCost) {
  using ist_proximity::ProximityArray;
  StatusInput input;
  EXPECT_EQ(decide(find_all(input, 0.0), true).code, ProximityArray::OK);
  input.deadline.unfinished = 3;
  input.deadline.widest = 0.0123;
  Status status = decide(find_all(input, 0.0), true);
  EXPECT_EQ(status.code, ProximityArray::DEGRADED);
  test::expect_says(status.text, "~query/deadline passed before 3 links met ~query/tolerance");
  test::expect_says(status.text, "12.3 mm wide");

  input.deadline = DeadlineCost();
  input.deadline.unblended = 1;
  status = decide(find_all(input, 0.0), true);
  EXPECT_EQ(status.code, ProximityArray::DEGRADED);
  test::expect_says(status.text, "the repulsion of 1 link was blended");

  input.deadline = DeadlineCost();
  input.deadline.no_penetration = 2;
  input.deadline.least_known = 0.4;
  status = decide(find_all(input, 0.0), true);
  EXPECT_EQ(status.code, ProximityArray::DEGRADED);
  test::expect_says(status.text, "the contact volume of 2 links");
  test::expect_says(status.text, "40 %");
}

}  // namespace
}  // namespace ist
