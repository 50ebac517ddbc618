#include "ros/output/markers.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "ros/unknown_space/unknown_space.h"
#include "support/scene.h"

namespace ist {
namespace {

using ist_proximity::ProximityArray;
using Link = ist_proximity::LinkProximity;
using visualization_msgs::Marker;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr double kLabelHeight = 0.04;  // [m]

Link link(const std::string& name, double distance, double x = 0.0) {
  Link one;
  one.link = name;
  one.distance = distance;
  one.state = std::isnan(distance) ? Link::UNKNOWN
              : distance == kInf   ? Link::CLEAR
              : distance < 0.0     ? Link::CONTACT
                                   : Link::NEAR;
  one.lower_bound = std::isnan(distance) ? -kInf : distance;
  one.point_on_link.x = one.point_on_obstacle.x = x;
  one.point_on_obstacle.z = -distance;
  one.repulsion.z = 0.5;
  one.robot_future = kNaN;
  return one;
}

ProximityArray array(const std::vector<Link>& links, std::uint8_t status = ProximityArray::OK) {
  ProximityArray message;
  message.header.frame_id = "base";
  message.status = status;
  message.links = links;
  return message;
}

std::map<std::pair<std::string, int>, Marker> by_key(const visualization_msgs::MarkerArray& all) {
  std::map<std::pair<std::string, int>, Marker> markers;
  for (const Marker& one : all.markers) markers[{one.ns, one.id}] = one;
  return markers;
}

TEST(NearestSummary, SaysWhatIsNearestAndWhatIsNotKnown) {
  NearestSummary all =
      summarize_nearest(array({link("a", 0.4), link("b", 0.2), link("c", kInf)}), 1.0, {});
  EXPECT_EQ(all.link, 1);
  EXPECT_EQ(all.text, "0.200 m\nb");
  EXPECT_EQ(summarize_nearest(array({link("a", 0.4), link("b", -0.02)}), 1.0, {}).text,
            "-0.020 m\nb");
  EXPECT_EQ(summarize_nearest(array({link("a", kInf)}), 0.5, {}).text, "> 0.50 m");
  Link unseen = link("a", kInf);
  unseen.lower_bound = 0.02;
  EXPECT_EQ(summarize_nearest(array({unseen}), 0.5, {}).text, "> 0.02 m");
  all = summarize_nearest(array({link("a", kNaN), link("b", kNaN)}, ProximityArray::STALE_CLOUD),
                          1.0, {});
  EXPECT_EQ(all.link, -1);
  EXPECT_EQ(all.text, "NOT KNOWN\nSTALE_CLOUD");
  EXPECT_EQ(summarize_nearest(array({}, ProximityArray::MODEL_ERROR), 1.0, {}).text,
            "NOT KNOWN\nMODEL_ERROR");
  // A base that is bolted to its table is not the news.
  all = summarize_nearest(array({link("base", 0.02), link("b", 0.2)}), 1.0, {false, true});
  EXPECT_EQ(all.text, "0.200 m\nb");
  // One unknown link must not vanish behind a clear one.
  all = summarize_nearest(array({link("a", kNaN), link("b", kInf)}, ProximityArray::NO_POSE), 1.0,
                          {});
  EXPECT_EQ(all.text, "> 1.00 m\n1 links NOT KNOWN\nNO_POSE");
}

TEST(NearnessColor, OneScale) {
  const auto is = [](double distance, float r, float g) {
    const std_msgs::ColorRGBA color = nearness_color(distance, 1.0);
    EXPECT_FLOAT_EQ(color.r, r) << distance;
    EXPECT_FLOAT_EQ(color.g, g) << distance;
  };
  is(-0.1, 1.0F, 0.0F);
  is(0.0, 1.0F, 0.0F);
  is(0.5, 1.0F, 1.0F);
  is(1.0, 0.0F, 1.0F);
  is(kInf, 0.0F, 1.0F);
  is(kNaN, 0.6F, 0.6F);
}

// Number and labels had places beside the vectors: they lay over the arm and over one another.
TEST(ProximityMarkers, LabelsAreAListAboveTheRobot) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  ProximityMarkers drawer(1.0, 1.0);
  for (int round = 0; round < 100; ++round) {
    std::vector<Link> links;
    for (int i = 0; i < 12; ++i) links.push_back(link("l" + std::to_string(i), uniform(random)));
    const Eigen::Vector3d corner(uniform(random), uniform(random), uniform(random));
    const Eigen::AlignedBox3d robot(corner, corner + Eigen::Vector3d(0.4, 0.4, 1.0));
    auto drawn = by_key(drawer.draw(array(links), {robot, {}}));
    if (round == 0) {
      EXPECT_GT((drawn[{"nearest", 0}].pose.position.z), robot.max().z());
    }
    for (int i = 0; i < 200; ++i)
      drawn = by_key(drawer.draw(array(links), {robot, {}}));  // it follows

    const Marker& number = drawn[{"nearest", 0}];
    std::vector<std::pair<double, double>> rows;  // distance, top of the row
    for (const auto& [key, one] : drawn) {
      if (key.first != "text" || one.action != Marker::ADD) continue;
      EXPECT_LE(links[static_cast<std::size_t>(key.second)].distance, 0.3);
      EXPECT_EQ(one.scale.z, kLabelHeight);
      EXPECT_EQ(one.pose.position.x, number.pose.position.x);
      EXPECT_EQ(one.pose.position.y, number.pose.position.y);
      EXPECT_GT(one.pose.position.z - one.scale.z / 2, robot.max().z());
      rows.emplace_back(links[static_cast<std::size_t>(key.second)].distance,
                        one.pose.position.z + one.scale.z / 2);
    }
    std::sort(rows.begin(), rows.end());
    ASSERT_LE(rows.size(), 4U);
    // Two lines of the number, with its middle in its place; then the labels, the nearest one
    // first.
    double free = number.pose.position.z - number.scale.z;
    for (const auto& [distance, top] : rows) {
      EXPECT_LT(top, free);
      free = top - kLabelHeight;
    }
  }
}

TEST(ProximityMarkers, WhatIsLeftUntilTheRobotStands) {
  ProximityMarkers drawer(1.0, 1.0);
  std::vector<Link> links = {link("a", 0.2), link("b", 0.2), link("c", 0.2)};
  links[0].robot_future = -0.05;
  links[1].robot_future = -kInf;
  auto drawn = by_key(drawer.draw(array(links), {}));
  EXPECT_EQ((drawn[{"text", 0}].text), "a 0.200 m, -0.050 m until it stands");
  EXPECT_EQ((drawn[{"text", 1}].text), "b 0.200 m, NOT KNOWN until it stands");
  EXPECT_EQ((drawn[{"text", 2}].text), "c 0.200 m");
}

TEST(ProximityMarkers, NamespacesAndIds) {
  ProximityMarkers drawer(1.0, 1.0);
  const Eigen::AlignedBox3d robot(Eigen::Vector3d::Zero(), Eigen::Vector3d::Ones());
  auto drawn = by_key(drawer.draw(
      array({link("far", 0.5), link("near", 0.2, 0.1), link("unknown", kNaN), link("c", kInf)}),
      {robot, {}}));
  for (const char* ns : {"distance", "point_on_link", "point_on_obstacle", "repulsion"}) {
    EXPECT_EQ(drawn.count({ns, 0}), 1U) << ns;
    EXPECT_EQ(drawn.count({ns, 1}), 1U) << ns;
    EXPECT_EQ(drawn.count({ns, 2}), 0U) << ns;
    EXPECT_EQ(drawn.count({ns, 3}), 0U) << ns;
  }
  // Labels of near links only, and the nearest link highlighted.
  EXPECT_EQ(drawn.count({"text", 0}), 0U);
  EXPECT_EQ((drawn[{"text", 1}].text), "near 0.200 m");
  EXPECT_EQ((drawn[{"nearest", 0}].text), "0.200 m\nnear\n1 links NOT KNOWN");
  EXPECT_EQ((drawn[{"nearest", 1}].points[1].x), 0.1);
  EXPECT_EQ((drawn[{"nearest", 2}].pose.position.x), 0.1);
  EXPECT_GT((drawn[{"nearest", 0}].scale.z), 2.0 * (drawn[{"text", 1}].scale.z));
  EXPECT_EQ(drawn.size(), 4U * 2U + 1U + 3U);
  // Arrows of repulsion are of no colour of the scale: those have little blue.
  EXPECT_GT((drawn[{"repulsion", 0}].color.b), 0.5F);

  drawn = by_key(drawer.draw(array({link("far", kInf), link("near", kInf)}), {robot, {}}));
  for (const auto& [key, one] : drawn) {
    const bool stays = key == std::pair<std::string, int>("nearest", 0);
    EXPECT_EQ(one.action, stays ? Marker::ADD : Marker::DELETE) << key.first << key.second;
  }
  EXPECT_EQ((drawn[{"nearest", 0}].text), "> 1.00 m");
  EXPECT_EQ(drawn.size(), 12U);
}

// Unknown space is drawn for the links that it is near, whatever their state is.
TEST(ProximityMarkers, LinesToUnknownSpace) {
  ProximityMarkers drawer(1.0, 1.0);
  const ProximityArray message = array({link("clear", kInf), link("near", 0.2)});
  const MarkerScene::UnseenLine line{0, {0.1, 0.2, 0.3}, {0.1, 0.2, 0.7}};
  auto drawn = by_key(drawer.draw(message, {{}, {line}}));
  ASSERT_EQ(drawn.count({"unseen", 0}), 1U);
  EXPECT_EQ(drawn.count({"unseen", 1}), 0U);
  const Marker& one = drawn[{"unseen", 0}];
  EXPECT_EQ(one.points[0].z, 0.7);
  EXPECT_EQ(one.points[1].z, 0.3);
  EXPECT_EQ(one.color.r, one.color.b);  // grey: not known
  EXPECT_EQ((drawn[{"unseen_end", 0}].pose.position.z), 0.7);

  drawn = by_key(drawer.draw(message, {}));
  EXPECT_EQ((drawn[{"unseen", 0}].action), Marker::DELETE);
  EXPECT_EQ((drawn[{"unseen_end", 0}].action), Marker::DELETE);
}

TEST(UnseenMarkers, CubesNearTheRobot) {
  const VoxelBoxes robot = {{Eigen::Vector3d(-1, -1, -1), Eigen::Vector3d(0, 0, 0)},
                            {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(1, 1, 1)}};
  const auto box = [](double x, double size) {
    const Eigen::Vector3d low(x, 0.5, 0.5);
    return Eigen::AlignedBox3d(low, low + Eigen::Vector3d(size, 0.02, 0.02));
  };
  std_msgs::Header header;
  header.frame_id = "odom";
  // Two voxels, a row that is drawn to 0.3 m, and a voxel that is too far.
  const auto drawn =
      unseen_markers({box(1.1, 0.02), box(1.2, 0.02), box(1.25, 0.16), box(1.5, 0.02)}, robot, 0.3,
                     header)
          .markers;
  ASSERT_EQ(drawn.size(), 1U);
  EXPECT_EQ(drawn[0].action, Marker::ADD);
  EXPECT_EQ(drawn[0].header.frame_id, "odom");
  EXPECT_NEAR(drawn[0].scale.x, 0.25 * 0.02, 1e-9);
  ASSERT_EQ(drawn[0].points.size(), 4U);
  EXPECT_NEAR(drawn[0].points[0].x, 1.11, 1e-9);
  EXPECT_NEAR(drawn[0].points[3].x, 1.31, 1e-9);
  ASSERT_EQ(drawn[0].colors.size(), 4U);
  EXPECT_GT(drawn[0].colors[0].a, drawn[0].colors[1].a);  // nearer
  EXPECT_GT(drawn[0].colors[1].a, 0.0F);
  // What was drawn goes where nothing is unknown any more.
  EXPECT_EQ(unseen_markers({}, robot, 0.3, header).markers[0].action, Marker::DELETE);

  // Too many: the nearest ones are drawn.
  VoxelBoxes many;
  for (int i = 0; i < 30000; ++i) many.push_back(box(1.28 - 1e-5 * i, 0.01));
  const auto nearest = unseen_markers(many, {robot[1]}, 0.3, header).markers;
  double farthest = 0.0;
  for (const auto& point : nearest[0].points) farthest = std::max(farthest, point.x);
  EXPECT_EQ(nearest[0].points.size(), 20000U);
  EXPECT_NEAR(farthest, 1.28 - 1e-5 * 10000 + 0.005, 1e-3);
}

// A link that nothing has been measured of yet looks neither near nor far.
TEST(Spheres, AreGreyUntilSomethingIsMeasured) {
  const auto model = test::make_model({Sphere{0.1}, Box{{0.1, 0.1, 0.1}}}, 0.01);
  const auto spheres = sphere_markers(*model, {0, 1}, 5);
  ASSERT_GE(spheres.markers.size(), 2U);
  for (const auto& marker : spheres.markers) {
    EXPECT_EQ(marker.color.r, marker.color.g) << marker.ns;
    EXPECT_EQ(marker.color.g, marker.color.b) << marker.ns;
  }
}

}  // namespace
}  // namespace ist
