#include "ros/model/model_state.h"

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/robot/robot_model.h"
#include "ros/common/text.h"
#include "ros/model/link_choice.h"

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

// `hull` is drawn around `fine`. What an SRDF disables by default is not monitored only where a
// finer link stands for it, and a hull never filters unless it is named.
TEST(LinkChoice, FollowsWhatIsMonitored) {
  using Names = std::vector<std::string>;
  struct Case {
    Names off, links, filter;
    bool all;
    const char *monitored, *filtering, *paired;
    std::size_t warnings;
  };
  const Case cases[] = {
      {{}, {}, {}, false, "fine hull other", "fine other", "", 1},
      {{"hull"}, {}, {}, false, "fine other", "fine other", "hull", 0},
      {{"hull", "fine", "other"}, {}, {}, false, "fine hull other", "fine other", "", 1},
      {{"other"}, {}, {}, false, "fine hull other", "fine other", "", 1},
      {{"hull"}, {"hull", "other"}, {}, false, "hull other", "fine other", "", 1},
      {{"hull"}, {"other"}, {}, false, "other", "other", "", 0},
      {{"hull"}, {}, {}, true, "fine other", "fine hull other", "hull", 0},
      {{"hull"}, {}, {"hull", "otter"}, false, "fine other", "hull", "hull", 1},
  };
  RobotDescription robot;
  robot.link_order = {"fine", "hull", "other"};
  for (const std::string& name : robot.link_order) robot.links.emplace_back().name = name;
  for (const Case& one : cases) {
    CollisionRules rules;
    rules.off.insert(one.off.begin(), one.off.end());
    rules.enabled.insert({"hull", "other"});
    ServerConfig config;
    config.sources.emplace_back();
    config.model.links = one.links;
    config.self_filter_links = one.filter;
    config.self_filter_all = one.all;
    const LinkChoice choice = choose_links(robot, rules, {{"hull", "fine", true}}, config);
    EXPECT_EQ(join(choice.monitored, " "), one.monitored);
    EXPECT_EQ(join(choice.filtering, " "), one.filtering) << one.monitored;
    EXPECT_EQ(join(choice.paired, " "), one.paired) << one.monitored;
    EXPECT_EQ(choice.warnings.size(), one.warnings) << join(choice.warnings, "; ");
    EXPECT_EQ(choice.remarks.find("hull (around fine)") != std::string::npos,
              choice.paired == Names{"hull"})
        << choice.remarks;
  }
}

}  // namespace
}  // namespace ist
