#include "ros/filter/proximity_rows.h"

#include <gtest/gtest.h>

#include <boost/make_shared.hpp>
#include <limits>
#include <memory>
#include <string>

#include "support/control_robots.h"

namespace ist {
namespace {

using ist_proximity::ProximityArray;

ProximityArray::Ptr message_of(const std::string& link, double size) {
  auto message = boost::make_shared<ProximityArray>();
  message->links.resize(1);
  message->links[0].link = link;
  message->links[0].box_center.x = 0.5 * size;
  message->links[0].box_size.x = size;
  return message;
}

// An object that was attached is in the one message before it is in the other.
TEST(ProximityRows, TellsLinksOfAnotherGeometry) {
  ProximityRows rows(test::demo_control_robot().kinematics);
  EXPECT_EQ(rows.other_geometry(), "");
  const ProximityArray::Ptr obstacles = message_of("gripper_link", 0.3);
  rows.set(obstacles, nullptr);
  EXPECT_EQ(rows.other_geometry(), "");
  rows.set(obstacles, message_of("gripper_link", 0.3));
  EXPECT_EQ(rows.other_geometry(), "");
  rows.set(obstacles, message_of("gripper_link", 0.2));
  EXPECT_EQ(rows.other_geometry(), "gripper_link");
  rows.set(obstacles, message_of("base_link", 0.2));
  EXPECT_EQ(rows.other_geometry(), "") << "of different links";
  rows.set(obstacles, message_of("gripper_link", std::numeric_limits<double>::quiet_NaN()));
  EXPECT_EQ(rows.other_geometry(), "") << "of an unknown link";
}

}  // namespace
}  // namespace ist
