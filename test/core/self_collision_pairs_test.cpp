#include "ist_proximity/proximity/self_query.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <set>
#include <string>
#include <vector>

#include "internal/robot/mesh_size.h"
#include "ist_proximity/geometry/error.h"
#include "ist_proximity/proximity/collision_rules.h"
#include "support/errors.h"

namespace ist {
namespace {

using Names = std::set<std::string>;

// base - turn - a - (fixed) plain, without geometry - turn - b - (fixed) tip; base - slide - c,
// whose sphere is in a's at rest.
const char* const kRobot = R"(<robot name="r">
  <link name="base"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
  <link name="a"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
  <link name="plain"/>
  <link name="b"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
  <link name="tip"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
  <link name="c"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
  <joint name="j1" type="continuous"><parent link="base"/><child link="a"/>
    <origin xyz="0 0 1"/></joint>
  <joint name="j2" type="fixed"><parent link="a"/><child link="plain"/></joint>
  <joint name="j3" type="continuous"><parent link="plain"/><child link="b"/>
    <origin xyz="0 0 1"/></joint>
  <joint name="j4" type="fixed"><parent link="b"/><child link="tip"/><origin xyz="0 0 1"/></joint>
  <joint name="j5" type="prismatic"><parent link="base"/><child link="c"/><origin xyz="0 0 0.6"/>
    <axis xyz="0 0 1"/><limit lower="0.25" upper="1" effort="1" velocity="1"/></joint>
</robot>)";

NamePairs disabled(const std::string& srdf_xml) {
  const CollisionRules rules = read_srdf(srdf_xml, nullptr);
  return {rules.disabled.begin(), rules.disabled.end()};
}

// A link with a sphere, and a joint that is named as its child.
std::string sphere(const std::string& name) {
  return "<link name='" + name +
         "'><collision><geometry><sphere radius='0.1'/></geometry></collision></link>";
}
std::string joint(const std::string& type, const std::string& parent, const std::string& child) {
  return "<joint name='" + child + "' type='" + type + "'><parent link='" + parent +
         "'/><child link='" + child + "'/></joint>";
}

struct Robot {
  explicit Robot(const std::string& urdf = kRobot)
      : description(parse_urdf(urdf, GeometrySource::kCollision, {})) {}

  RobotDescription description;
  std::shared_ptr<const RobotModel> model = build_robot_model(description, {});
  Kinematics kinematics{description};

  std::vector<LinkPair> pairs(const NamePairs& ignored = {},
                              const CollisionRules& rules = {}) const {
    return self_collision_pairs(*model, kinematics, std::vector<bool>(model->links.size(), true),
                                ignored, rules);
  }
  Names names(const std::vector<LinkPair>& pairs) const {
    Names result;
    for (const LinkPair& pair : pairs) {
      result.insert(model->links[pair.first].name + "-" + model->links[pair.second].name);
    }
    return result;
  }
};

TEST(SelfCollisionPairs, excludesAdjacentAndRigidlyConnectedLinks) {
  const Robot robot;
  // Adjacent: base-a, a-b (plain does not count), b-tip (rigid as well), base-c.
  const Names all = {"base-b", "base-tip", "a-tip", "a-c", "b-c", "tip-c"};
  EXPECT_EQ(robot.names(robot.pairs()), all);
  const Names fewer = {"base-b", "base-tip", "a-tip", "tip-c"};
  EXPECT_EQ(robot.names(robot.pairs({{"c", "a"}, {"b", "c"}, {"b", "nobody"}})), fewer);
  std::vector<bool> wanted(robot.model->links.size(), true);
  wanted[1] = false;  // a
  ASSERT_EQ(robot.model->links[1].name, "a");
  const Names without_a = {"base-b", "base-tip", "b-c", "tip-c"};
  EXPECT_EQ(robot.names(self_collision_pairs(*robot.model, robot.kinematics, wanted, {})),
            without_a);
}

// What parts two links is the URDF's geometry, be it monitored or not; an attached object is none.
TEST(SelfCollisionPairs, AdjacentLinksAreThoseOfTheUrdf) {
  Robot some;
  RobotModelConfig config;
  config.links = {"base", "b", "c"};
  some.model = build_robot_model(some.description, config);
  EXPECT_EQ(some.names(some.pairs()), (Names{"base-b", "b-c"})) << "a is between base and b";

  AttachedObject object{"tool", "plain", {Sphere{0.1}, Eigen::Isometry3d::Identity(), "sphere"}};
  Robot carrying;
  carrying.model = build_robot_model(with_objects(carrying.description, {object}), {});
  const Names pairs = carrying.names(carrying.pairs());
  EXPECT_EQ(pairs.count("plain-b") + pairs.count("b-plain"), 1U);
  EXPECT_EQ(pairs.count("base-plain") + pairs.count("plain-base"), 1U);
  EXPECT_EQ(pairs.count("a-b"), 0U);

  const std::string urdf =
      "<robot name='r'><link name='root'/>" + sphere("ball") + joint("continuous", "root", "ball");
  Robot bare(urdf + "</robot>");
  object.link = "root";
  bare.model = build_robot_model(with_objects(bare.description, {object}), {});
  EXPECT_EQ(bare.pairs().size(), 1U);
}

// An SRDF may name hundreds of thousands of pairs; the node does not answer, nor end, before it has
// looked at all of them.
TEST(SelfCollisionPairs, ManyIgnoredNamesTakeNoTime) {
  std::string urdf = "<robot name='r'>";
  NamePairs ignored;
  for (int i = 0; i < 60; ++i) {
    const std::string name = "link_" + std::to_string(i);
    urdf += sphere(name);
    if (i > 0) urdf += joint("continuous", "link_" + std::to_string(i - 1), name);
  }
  urdf += "</robot>";
  for (int i = 0; i < 300000; ++i) ignored.emplace_back("link_7", "tool_" + std::to_string(i));
  ignored.emplace_back("link_9", "link_5");
  const Robot robot(urdf);
  const auto begin = std::chrono::steady_clock::now();
  const auto pairs = robot.pairs(ignored);
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  EXPECT_EQ(pairs.size(), 60U * 59U / 2U - 59U - 1U);
  EXPECT_LT(took.count(), 3.0) << "half a second; twelve where each pair looks at each name";
}

TEST(SelfCollisionPairs, siblingsAreNotAdjacent) {
  // Two fingers on a link without geometry.
  const Robot hand("<robot name='r'><link name='hand'/>" + sphere("left") + sphere("right") +
                   joint("continuous", "hand", "left") + joint("continuous", "hand", "right") +
                   "</robot>");
  EXPECT_EQ(hand.pairs().size(), 1U);
}

TEST(SelfCollisionPairs, inContactAtRest) {
  const Robot robot;
  // c's lower limit brings it to 0.85 m, into a's sphere at 1 m.
  const auto found = in_contact_at_rest(robot.model, robot.kinematics, robot.pairs());
  EXPECT_EQ(robot.names(found), Names{"a-c"});
}

// Two carts with a tool each, of which one floats: their pose relative to each other at zero means
// nothing.
TEST(SelfCollisionPairs, floatingBodiesHaveNoRest) {
  const Robot carts("<robot name='r'><link name='world'/>" + sphere("a") + "<link name='a0'/>" +
                    sphere("a1") + sphere("b") + "<link name='b0'/>" + sphere("b1") +
                    joint("planar", "world", "a") + joint("continuous", "a", "a0") +
                    joint("continuous", "a0", "a1") + joint("floating", "world", "b") +
                    joint("continuous", "b", "b0") + joint("continuous", "b0", "b1") + "</robot>");
  const std::vector<LinkPair> all = {{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}};
  const auto found = in_contact_at_rest(carts.model, carts.kinematics, all);
  EXPECT_EQ(carts.names(found), (Names{"a-a1", "b-b1"}));
}

// c slides from 0.85 to 1.6 m, past a at 1 m: it touches a below 1.2 m. With a radius of 0.6 m
// it always does.
TEST(SelfCollisionPairs, SamplingFindsWhatNeverAndAlwaysTouches) {
  const Robot robot;
  const std::vector<LinkPair> pairs = robot.pairs();
  const auto sampled = sample_pairs(robot.model, robot.kinematics, pairs, {500, 7});
  ASSERT_EQ(sampled.size(), pairs.size());
  for (const SampledPair& found : sampled) {
    EXPECT_EQ(found.measured, 500U);
    if (robot.names({found.pair}) != Names{"a-c"}) continue;
    EXPECT_FALSE(found.always() || found.never());
    EXPECT_NEAR(static_cast<double>(found.contacts), 500 * 0.35 / 0.75, 40.0);
  }
  const auto with_radius = [](const std::string& radius) {
    std::string urdf = kRobot;
    const std::string old = "<link name=\"c\"><collision><geometry><sphere radius=\"0.1\"/>";
    urdf.replace(urdf.find(old), old.size(),
                 "<link name=\"c\"><collision><geometry><sphere radius=\"" + radius + "\"/>");
    const Robot other(urdf);
    std::vector<LinkPair> a_c;
    for (const LinkPair& pair : other.pairs()) {
      if (other.names({pair}) == Names{"a-c"}) a_c.push_back(pair);
    }
    return sample_pairs(other.model, other.kinematics, a_c, {100, 7}).at(0);
  };
  EXPECT_TRUE(with_radius("0.6").always());
  EXPECT_FALSE(with_radius("0.6").never());
  const auto again = sample_pairs(robot.model, robot.kinematics, pairs, {500, 7});
  for (std::size_t i = 0; i < again.size(); ++i) EXPECT_EQ(again[i].contacts, sampled[i].contacts);
}

TEST(SelfCollisionPairs, SamplingEndsWhenItIsCancelled) {
  const Robot robot;
  int asked = 0;
  const auto sampled = sample_pairs(robot.model, robot.kinematics, robot.pairs(), {500, 1},
                                    [&] { return ++asked > 10; });
  EXPECT_EQ(sampled[0].measured, 10U);
}

TEST(SelfCollisionPairs, WritesAnSrdfThatIsReadAgain) {
  const Robot robot;
  std::vector<SampledPair> sampled;
  for (const LinkPair& pair : robot.pairs()) sampled.push_back({pair, 5, 5});
  sampled[0].contacts = 0;  // base-b
  sampled[1].contacts = 3;  // base-tip
  const auto left = [&](bool never) {
    return robot.names(
        robot.pairs(disabled(to_srdf(*robot.model, robot.kinematics, sampled, never))));
  };
  const Names without_always = {"base-b", "base-tip"};
  EXPECT_EQ(left(false), without_always);
  EXPECT_EQ(left(true), Names{"base-tip"});
}

TEST(SelfCollisionPairs, srdf) {
  const NamePairs expected = {{"a", "b"}, {"a", "c"}};
  EXPECT_EQ(disabled("<robot name='r'><group name='g'/>"
                     "<disable_collisions link1='a' link2='b' reason='Never'/>"
                     "<disable_collisions link1='c' link2='a'/></robot>"),
            expected);
  EXPECT_THROW(disabled("<robot"), ModelError);
  EXPECT_THROW(disabled("<other/>"), ModelError);
  EXPECT_THROW(disabled("<robot><disable_collisions link1='a'/></robot>"), ModelError);
}

// MoveIt's order: off by default, then enabled, then disabled.
TEST(SelfCollisionPairs, SrdfDefaults) {
  const Robot robot;  // base-b, base-tip, a-tip, a-c, b-c and tip-c are not adjacent
  const auto left = [&](const std::string& elements) {
    const CollisionRules rules =
        read_srdf("<robot name='r'>" + elements + "</robot>", &robot.kinematics);
    EXPECT_TRUE(rules.doubts.empty());
    return robot.names(robot.pairs({}, rules));
  };
  const std::string off = "<disable_default_collisions link='c'/>";
  const std::string on = "<enable_collisions link1='c' link2='tip'/>";
  const Names without_c = {"base-b", "base-tip", "a-tip"};
  EXPECT_EQ(left(off), without_c);
  const Names one_of_c = {"base-b", "base-tip", "a-tip", "tip-c"};
  EXPECT_EQ(left(off + on), one_of_c);
  EXPECT_EQ(left(on + off), one_of_c);
  EXPECT_EQ(left(on + off + "<disable_collisions link1='tip' link2='c'/>"), without_c);
  EXPECT_EQ(left(off + "<disable_default_collisions link='tip'/>" + on),
            (Names{"base-b", "tip-c"}));
  // Adjacent links that are stated are watched, but rigidly connected ones cannot move.
  const std::string adjacent =
      "<enable_collisions link1='base' link2='a'/><enable_collisions link1='b' link2='tip'/>";
  EXPECT_EQ(left(off + adjacent), (Names{"base-a", "base-b", "base-tip", "a-tip"}));
}

TEST(SelfCollisionPairs, SrdfTellsWhatItDoesNotUse) {
  const Robot robot;
  const CollisionRules rules = read_srdf(
      "<robot name='r'><group name='g'><chain base_link='x' tip_link='y'/></group>\n"
      "<disable_colisions link1='a' link2='c'/><disable_colisions link1='a' link2='b'/>\n"
      "<disable_collisions link1='a' link2='cc'/><enable_collisions link1='cc' link2='b'/>\n"
      "<disable_default_collisions link='d'/></robot>",
      &robot.kinematics);
  ASSERT_EQ(rules.doubts.size(), 2U);
  EXPECT_EQ(
      rules.doubts[0],
      "the SRDF has elements that are not known and have no effect: <disable_colisions> (line "
      "2)");
  EXPECT_EQ(rules.doubts[1],
            "the SRDF names links that are not in the URDF: 'cc' in <disable_collisions> (line 3), "
            "'d' in <disable_default_collisions> (line 4)");
  for (const char* element : {"<enable_collisions link2='a'/>", "<disable_default_collisions/>"}) {
    EXPECT_THROW(read_srdf("<robot>" + std::string(element) + "</robot>", nullptr), ModelError);
  }
}

// An SRDF of another robot, of a million pairs, is told in a line and does not hold up the end.
TEST(SelfCollisionPairs, LargeSrdf) {
  const Robot robot;
  std::string srdf = "<robot name='r'>";
  for (int i = 0; i < 20000; ++i) {
    srdf += "<disable_collisions link1='x" + std::to_string(i) + "' link2='a'/>";
  }
  srdf += "</robot>";
  const CollisionRules rules = read_srdf(srdf, &robot.kinematics);
  EXPECT_EQ(rules.disabled.size(), 20000U);
  ASSERT_EQ(rules.doubts.size(), 1U);
  test::expect_says(rules.doubts[0], "'x9' in <disable_collisions> (line 1) and 19990 more");
  int asked = 0;
  EXPECT_THROW(read_srdf(srdf, nullptr, [&] { return ++asked == 3; }), ModelError);
  EXPECT_EQ(asked, 3);
}

// base - j - arm - k - tip: a sphere far out on the arm, another one on the base in its way.
struct Limits {
  std::string type = "revolute";  // of j
  std::string limit;              // attributes
  std::string mimic;              // k follows j
  std::string k_type = "continuous";
};

std::vector<std::size_t> sampled_contacts(const Limits& limits, std::string* doubts,
                                          RobotDescription* description) {
  const std::string at = "<collision><origin xyz='0 1 0'/><geometry><sphere radius='0.1'/>";
  const std::string urdf =
      "<robot name='r'><link name='base'>" + at +
      "</geometry></collision></link><link name='arm'/>" + sphere("fore") + sphere("tip") +
      "<joint name='j' type='" + limits.type +
      "'><parent link='base'/><child link='arm'/><axis xyz='0 0 1'/><limit effort='1' "
      "velocity='0' " +
      limits.limit +
      "/></joint><joint name='f' type='fixed'><parent link='arm'/><child link='fore'/>"
      "<origin xyz='0 0.4 0'/></joint><joint name='k' type='" +
      limits.k_type +
      "'><parent link='fore'/><child link='tip'/><origin xyz='0 0.6 0'/><axis xyz='0 0 1'/>"
      "<limit effort='1' velocity='1' lower='-1' upper='1'/>" +
      limits.mimic + "</joint></robot>";
  const Robot robot(urdf);
  *description = robot.description;
  *doubts = sampling_doubts(robot.kinematics);
  const SampledPair found = sample_pairs(robot.model, robot.kinematics, {{0, 2}}, {2000, 1}).at(0);
  EXPECT_EQ(in_contact_at_rest(robot.model, robot.kinematics, {{0, 2}}).size(), 1U);
  return {found.contacts, found.measured};
}

// Limits without a range, as exporters write them: a joint that turns is drawn over a turn, one
// that slides cannot be drawn.
TEST(SelfCollisionPairs, JointsThatStateNoLimits) {
  std::string doubts;
  RobotDescription robot;
  const double share = 2.0 * std::asin(0.1) / 3.14159265;  // of a turn in which the spheres touch
  for (const std::string limit : {"lower='0' upper='0'", "", "lower='1' upper='-1'",
                                  "lower='0.3' upper='0.3'", "lower='-1e9' upper='1e9'"}) {
    const auto found = sampled_contacts({"revolute", limit, ""}, &doubts, &robot);
    EXPECT_NEAR(static_cast<double>(found[0]), 2000 * share, 60.0) << limit;
    EXPECT_EQ(found[1], 2000U);
    EXPECT_EQ(doubts, "joints without limits are drawn from -pi to pi: 'j'");
    EXPECT_EQ(doubtful_limits(robot),
              "joints that state no limits, a lower one below an upper one, and are taken to have "
              "none: 'j'");
    const auto slide = sampled_contacts({"prismatic", limit, ""}, &doubts, &robot);
    EXPECT_EQ(slide[1], 0U) << "nothing is known of it";
    EXPECT_NE(doubts.find("cannot be sampled"), std::string::npos);
  }
  EXPECT_EQ(sampled_contacts({"continuous", "", ""}, &doubts, &robot)[1], 2000U);
  EXPECT_EQ(doubts, "");
  EXPECT_EQ(sampled_contacts({"revolute", "lower='-1' upper='1'", ""}, &doubts, &robot)[1], 2000U);
  EXPECT_EQ(doubts, "");
  EXPECT_EQ(doubtful_limits(robot), "");
  // Joints that follow one whose positions have no range: a slide, and a gear of several turns.
  const auto follow = [&](const std::string& limit, const std::string& type, double multiplier) {
    const std::string mimic = "<mimic joint='j' multiplier='" + std::to_string(multiplier) + "'/>";
    return sampled_contacts({"revolute", limit, mimic, type}, &doubts, &robot)[1];
  };
  EXPECT_EQ(follow("lower='-1' upper='1'", "prismatic", 0.1), 2000U);
  EXPECT_EQ(follow("", "prismatic", 0.1), 0U);
  EXPECT_EQ(follow("", "continuous", 0.5), 0U);
  EXPECT_EQ(follow("", "continuous", -2.0), 2000U);
}

}  // namespace
}  // namespace ist
