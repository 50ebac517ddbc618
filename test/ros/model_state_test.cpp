#include "ros/model/model_state.h"

#include <gtest/gtest.h>

#include <memory>

#include "ist_proximity/robot/robot_model.h"

namespace ist {
namespace {

ModelState state_of(std::size_t links, std::size_t monitored, std::size_t broken) {
  auto robot = std::make_shared<RobotModel>();
  robot->links.resize(links);
  for (std::size_t i = 0; i < broken; ++i) robot->links[i].error = "no mesh";
  ModelState state;
  for (std::size_t i = 0; i < monitored; ++i) state.monitored.push_back(i);
  state.robot = robot;
  return state;
}

// The log said "21 links monitored, 21 packed" with a mesh missing, and "2 monitored, 8 packed".
TEST(LinkCounts, CountWhatIsThere) {
  EXPECT_EQ(link_counts(state_of(21, 21, 0)), "21 links monitored");
  EXPECT_EQ(link_counts(state_of(21, 21, 1)).substr(0, 31), "20 links monitored, 1 UNKNOWN (");
  EXPECT_EQ(link_counts(state_of(8, 2, 0)), "2 links monitored, 6 more packed for the self-filter");
  EXPECT_EQ(link_counts(state_of(0, 0, 0)), "0 links monitored");
}

}  // namespace
}  // namespace ist
