// Sampled pairs of the Panda beside the SRDF that MoveIt publishes for it.

#include <gtest/gtest.h>

#include <fstream>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "ist_proximity/proximity/self_query.h"
#include "support/data_dir.h"
#include "support/sanitizers.h"

namespace ist {
namespace {

using Names = std::set<std::string>;

// Facts from panda_moveit_config/config/panda.srdf of moveit/moveit_resources (commit 8c2f1ed): the
// pairs with reason "Never" and "Adjacent". A digit N stands for panda_linkN.
const Names kNever = {"0-2",    "0-3",     "0-4",     "1-3",     "1-4",    "2-4",
                      "2-6",    "3-5",     "3-6",     "3-7",     "4-6",    "4-7",
                      "3-hand", "4-hand",  "6-hand",  "3-left",  "4-left", "6-left",
                      "7-left", "3-right", "4-right", "6-right", "7-right"};
const Names kAdjacent = {"0-1", "1-2", "2-3",    "3-4",       "4-5",
                         "5-6", "6-7", "7-hand", "hand-left", "hand-right"};

std::string shortened(const std::string& link) {
  if (link == "panda_leftfinger") return "left";
  if (link == "panda_rightfinger") return "right";
  return link == "panda_hand" ? "hand" : link.substr(std::string("panda_link").size());
}

// The same pairs. In contact at rest are the fingers, which the SRDF disables as "Default", and two
// pairs that the SRDF watches: with all joints at zero the hand is folded into link 5.
TEST(PandaPairs, AreThoseOfThePublishedSrdf) {
  const auto data = test::data_dir();
  if (!data) GTEST_SKIP() << test::kNoData;
  if (test::kSanitized) GTEST_SKIP() << "takes minutes";
  const std::string package = test::franka_package(*data);
  std::ifstream file(package + "/robots/panda.urdf");
  std::stringstream text;
  text << file.rdbuf();
  const RobotDescription description = parse_urdf(text.str(), GeometrySource::kCollision,
                                                  [&](const std::string&) { return package; });
  RobotModelConfig config;
  config.packing.max_error = 0.02;
  const auto model = build_robot_model(description, config);
  const Kinematics kinematics(description);
  const std::vector<bool> all(model->links.size(), true);
  const auto name = [&](const LinkPair& pair) {
    return shortened(model->links[pair.first].name) + "-" +
           shortened(model->links[pair.second].name);
  };
  const std::vector<LinkPair> pairs = self_collision_pairs(*model, kinematics, all, {});
  Names adjacent, never, always;
  for (std::size_t i = 0; i < all.size(); ++i) {
    for (std::size_t k = i + 1; k < all.size(); ++k) adjacent.insert(name({i, k}));
  }
  for (const LinkPair& pair : pairs) adjacent.erase(name(pair));
  EXPECT_EQ(adjacent, kAdjacent);
  for (const SampledPair& sampled : sample_pairs(model, kinematics, pairs, {})) {
    if (sampled.never()) never.insert(name(sampled.pair));
    if (sampled.always()) always.insert(name(sampled.pair));
  }
  EXPECT_EQ(never, kNever);
  EXPECT_EQ(always, Names());
  Names at_rest;
  for (const LinkPair& pair : in_contact_at_rest(model, kinematics, pairs)) {
    at_rest.insert(name(pair));
  }
  EXPECT_EQ(at_rest, (Names{"5-7", "5-hand", "left-right"}));
}

}  // namespace
}  // namespace ist
