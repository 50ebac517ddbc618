// A cycle without a ROS master: what it costs, and what its parts are.

#include <gtest/gtest.h>
#include <ist_proximity/ProximityArray.h>
#include <ros/time.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "internal/proximity/deadline.h"
#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/contact/contact_model.h"
#include "ist_proximity/robot/link_poses.h"
#include "ros/cycle/proximity_cycle.h"
#include "ros/output/message_pool.h"
#include "support/allocations.h"
#include "support/cycle_parts.h"
#include "support/demo_arm.h"

namespace ist {
namespace {

using ist_proximity::ProximityArray;

constexpr std::size_t kWidth = 64, kHeight = 48;
// Longer than what a string holds without an allocation.
constexpr char kSource[] = "the_camera_at_the_end_of_the_bench";

// A wall that the camera looks at, `depth` [m] away.
RawCloud wall(float depth, std::shared_ptr<std::vector<float>>* xyz) {
  *xyz = std::make_shared<std::vector<float>>();
  for (std::size_t i = 0; i < kWidth * kHeight; ++i) {
    (*xyz)->push_back(depth);
    (*xyz)->push_back(0.02F * static_cast<float>(i % kWidth) - 0.64F);
    (*xyz)->push_back(0.02F * static_cast<float>(i / kWidth));
  }
  RawCloud cloud = packed_cloud((*xyz)->data(), kWidth, kHeight);
  cloud.owner = *xyz;
  return cloud;
}

// The demo arm's volumes, packed coarsely.
std::shared_ptr<const ContactModel> contacts_of(const std::shared_ptr<const RobotModel>& robot,
                                                const RobotDescription& description) {
  auto contacts = std::make_shared<ContactModel>();
  contacts->robot = robot;
  ContactConfig config;
  config.packing.max_spheres = 30;
  for (std::size_t i = 0; i < robot->links.size(); ++i) {
    contacts->links.push_back(
        build_contact_geometry(description.links[i].geometry, 0, robot->links[i], config, ""));
  }
  return contacts;
}

class Cycle : public ::testing::Test {
 protected:
  Cycle()
      : description_(test::demo_robot()),
        robot_(test::demo_model()),
        kinematics_(description_),
        q_(kinematics_.joints().size(), 0.0),
        ingest_(IngestConfig()) {
    ros::Time::init();
    auto poses = std::make_unique<test::StatedPoses>();
    poses_ = poses.get();
    poses_->set(link_poses(*robot_, kinematics_, q_).X_FL);
    cycle_ = std::make_unique<ProximityCycle>(test::ready_model(robot_), ServerConfig(),
                                              std::move(poses), CloudSelection::Reader::kOnly);
    auto source = std::make_unique<test::StatedSource>(kSource);
    source_ = source.get();
    sources_.push_back(std::move(source));
    live_.contacts = contacts_of(robot_, description_);
    live_.query.deadline = 0.0;
    // As in a URDF, the model's links and the description's are in the same order.
    for (std::size_t i = 0; i < robot_->links.size(); ++i) {
      EXPECT_EQ(robot_->links[i].name, description_.links[i].name);
    }
  }

  void see_wall(float depth) {
    ingest_.run(wall(depth, &xyz_), Eigen::Isometry3d::Identity(), {}, now_.toSec(),
                source_->cloud(now_));
  }

  // Moves the arm, runs a cycle and reports it. Returns the allocations of cycle and report.
  long step(boost::shared_ptr<ProximityArray>* message) {
    now_ += ros::Duration(0.001);
    for (double& position : q_) position += 1e-4;
    poses_->set(link_poses(*robot_, kinematics_, q_).X_FL);
    if (is_fresh_) source_->cloud(now_);
    const long before = test::allocations;
    *message = messages_.take();
    cycle_->run(now_, sources_, live_, transform_problem_, message->get());
    cycle_->report(**message, &report_);
    return test::allocations - before;
  }

  RobotDescription description_;
  std::shared_ptr<const RobotModel> robot_;
  Kinematics kinematics_;
  std::vector<double> q_;
  Ingest ingest_;
  std::shared_ptr<std::vector<float>> xyz_;
  test::StatedPoses* poses_ = nullptr;
  test::StatedSource* source_ = nullptr;
  CloudSources sources_;
  std::unique_ptr<ProximityCycle> cycle_;
  LiveConfig live_;
  MessagePool<ProximityArray> messages_;
  CycleReport report_;
  const std::string transform_problem_;
  ros::Time now_{100.0};
  bool is_fresh_ = true;  // the cloud in use has the newest stamp
};

// Messages, strings and lists are used again.
TEST_F(Cycle, AllocatesNothingOnceItIsSteady) {
  // The last wall passes through the arm.
  int contacts = 0;
  for (const float depth : {0.8F, 0.5F, 0.1F}) {
    see_wall(depth);
    q_.assign(q_.size(), 0.0);
    boost::shared_ptr<ProximityArray> message;
    for (int i = 0; i < 10; ++i) step(&message);  // the pool's messages get their memory
    for (int i = 0; i < 2000; ++i) {              // more than the report keeps the times of
      const long count = step(&message);
      if (i < 1000) continue;
      ASSERT_EQ(count, 0) << "wall at " << depth << ", cycle " << i;
      for (const auto& link : message->links) {
        if (link.state != link.CONTACT) continue;
        ++contacts;
        EXPECT_TRUE(std::isfinite(link.penetration.force.x)) << link.link;
      }
    }
    ASSERT_EQ(message->status, ProximityArray::OK) << message->status_text;
    ASSERT_EQ(message->links.size(), robot_->links.size());
    EXPECT_EQ(message->sources.at(0).name, kSource);
    see_wall(depth + 0.05F);
    EXPECT_EQ(step(&message), 0) << "the first cycle with a new cloud";
  }
  EXPECT_GT(contacts, 0);
}

// What a late frame may have moved is taken off the bounds, however little it is.
TEST_F(Cycle, AllocatesNothingWhereAFrameIsLate) {
  see_wall(0.5F);
  Lag lag;
  lag.frame = "the_frame_of_the_map_on_the_bench";
  lag.age = lag.window = 0.1;
  lag.windows = lag.moved.size();
  lag.moved.fill(Eigen::Isometry3d(Eigen::Translation3d(1e-4, 0.0, 0.0)));
  source_->set_lag(lag);
  int near = 0;
  for (int i = 0; i < 2000; ++i) {
    boost::shared_ptr<ProximityArray> message;
    const long count = step(&message);
    if (i < 1000) continue;
    ASSERT_EQ(count, 0) << "cycle " << i;
    ASSERT_EQ(message->status, ProximityArray::OK) << message->status_text;
    for (const auto& link : message->links) {
      if (link.state != link.NEAR) continue;
      ++near;
      EXPECT_GT(link.distance - link.lower_bound, 1e-4 - 1e-9) << link.link;
    }
  }
  EXPECT_GT(near, 1000);
}

// A message that a subscriber holds is not written to; what it no longer holds is used again.
TEST_F(Cycle, LeavesMessagesAloneThatOthersHold) {
  see_wall(0.5F);
  std::vector<boost::shared_ptr<ProximityArray>> held(40);
  std::vector<ros::Time> stamps;
  for (auto& message : held) {
    step(&message);
    stamps.push_back(message->header.stamp);
  }
  for (std::size_t i = 0; i < held.size(); ++i) {
    EXPECT_EQ(held[i]->header.stamp, stamps[i]);
    for (std::size_t k = 0; k < i; ++k) ASSERT_NE(held[i], held[k]);
  }
}

// A field that one cycle has set must not stay in the message of another one.
TEST_F(Cycle, MessagesThatAreUsedAgainHoldTheirOwnCycleOnly) {
  boost::shared_ptr<ProximityArray> message;
  see_wall(0.1F);
  for (int i = 0; i < 20; ++i) step(&message);
  source_->cloud(now_ - ros::Duration(90.0));  // stale
  is_fresh_ = false;
  for (int i = 0; i < 20; ++i) {
    step(&message);
    EXPECT_EQ(message->status, ProximityArray::STALE_CLOUD);
    EXPECT_NE(message->status_text, "");
    for (const auto& link : message->links) {
      EXPECT_EQ(link.state, link.UNKNOWN);
      EXPECT_EQ(link.source, "");
      EXPECT_TRUE(std::isnan(link.distance) && std::isnan(link.penetration.force.x));
      EXPECT_EQ(link.closing_unknown, link.ROBOT_UNKNOWN | link.OBSTACLES_UNKNOWN);
    }
  }
  is_fresh_ = true;
  see_wall(3.0F);  // CLEAR: out of range
  for (int i = 0; i < 20; ++i) {
    step(&message);
    EXPECT_EQ(message->status, ProximityArray::OK);
    EXPECT_EQ(message->status_text, "");
    for (const auto& link : message->links) EXPECT_EQ(link.source, "");
  }
}

// Who may vouch for what is free, and what is said where nobody does.
TEST(Vouching, NeedsAFreshSourceThatMeasures) {
  struct Source {
    char kind;  // s: sensor, a: one that has never been there, w: known world, m: memory
    bool required, ok;
  };
  struct Case {
    std::vector<Source> sources;
    std::uint8_t status;
  };
  constexpr auto kOk = ProximityArray::OK, kStale = ProximityArray::STALE_CLOUD;
  const std::vector<Case> cases = {
      {{{'s', true, true}}, kOk},
      {{{'s', true, false}}, kStale},
      {{{'s', false, true}}, kOk},
      {{{'s', false, false}}, kStale},
      {{{'s', false, false}, {'m', false, true}}, kStale},
      {{{'s', false, true}, {'m', false, false}}, kOk},
      {{{'s', false, false}, {'m', false, true}, {'s', false, true}}, kOk},
      {{{'s', false, false}, {'s', false, false}, {'m', false, true}}, kStale},
      {{{'s', true, false}, {'s', false, true}}, kStale},
      {{{'s', false, false}, {'w', true, true}}, kStale},  // a known world sees nothing
      {{{'s', false, false}, {'w', false, true}, {'m', false, true}}, kStale},
      {{{'s', false, true}, {'w', false, false}}, kOk},
      {{{'s', false, true}, {'w', true, false}}, kStale},
      {{{'w', true, true}}, kOk},  // and where it is all, distances to it were asked for
      {{{'w', false, true}, {'w', false, false}}, kOk},
      {{{'w', false, false}}, kStale},
      {{{'w', true, true}, {'w', true, false}}, kStale},
      {{{'a', false, false}, {'w', true, true}}, kOk},
      {{{'a', false, false}, {'w', false, true}}, kStale},
      {{{'a', true, false}, {'w', true, true}}, kStale},
      {{{'a', false, false}, {'s', false, false}, {'w', true, true}}, kStale},
      {{{'a', false, false}, {'m', false, true}}, kStale},
  };
  for (std::size_t k = 0; k < cases.size(); ++k) {
    StatusInput input;
    for (const Source& source : cases[k].sources) {
      SourceReport report;
      report.name = std::string(1, source.kind);
      report.measures = source.kind == 's' || source.kind == 'a';
      report.has_been_there = source.kind == 's';
      report.is_memory = source.kind == 'm';
      report.required = source.required;
      report.messages = 1;
      report.newest = source.ok ? 100.0 : 90.0;
      report.status = source.ok ? Status{kOk, ""} : Status{kStale, "is old"};
      input.sources.push_back(report);
    }
    EXPECT_EQ(decide(find_all(input, 100.0), true).code, cases[k].status) << "case " << k;
    EXPECT_EQ(clouds_usable(input), cases[k].status == kOk) << "case " << k;
  }
}

// A map in a frame that moves comes as fast as that. Infinite timeouts say that obstacles do not go
// stale, not that they stand still.
TEST_F(Cycle, WhatNeverGoesStaleMayMove) {
  source_->set_timeout(std::numeric_limits<double>::infinity());
  CloudSnapshot* map = source_->cloud(now_);
  const auto boxes = std::make_shared<BoxIndex>();
  boxes->build({{Eigen::Vector3d(0.0, -0.5, 0.0), Eigen::Vector3d(0.1, 0.5, 1.0)}});
  map->boxes = boxes;
  double x = 0.7;  // [m] of the map's frame
  const auto nearest_after = [&](double seconds, double speed) {
    boost::shared_ptr<ProximityArray> message = messages_.take();
    for (const ros::Time end = now_ + ros::Duration(seconds); now_ < end;) {
      now_ += ros::Duration(0.001);
      x += 0.001 * speed;
      map->X_FM = Eigen::Isometry3d(Eigen::Translation3d(x, 0.0, 0.0));
      cycle_->run(now_, sources_, live_, transform_problem_, message.get());
    }
    return *std::min_element(message->links.begin(), message->links.end(),
                             [](const auto& a, const auto& b) { return a.distance < b.distance; });
  };
  auto link = nearest_after(0.1, 0.0);
  EXPECT_EQ(link.closing_speed_obstacles, 0.0);
  EXPECT_EQ(link.closing_unknown, 0);
  for (const double speed : {-0.2, 0.2, -0.04}) {
    link = nearest_after(1.0, speed);
    EXPECT_NEAR(link.closing_speed_obstacles, -speed, 0.1 * std::abs(speed));
    if (speed < 0.0) {
      EXPECT_NEAR(link.time_to_contact, link.lower_bound / -speed, 0.5);
    }
  }
  EXPECT_EQ(nearest_after(1.1, 0.0).closing_speed_obstacles, 0.0) << "it has stopped";

  // A cloud that comes again and again is no obstacle that stands still either.
  *map = CloudSnapshot();
  see_wall(0.6F);
  link = nearest_after(0.1, 0.0);
  EXPECT_EQ(link.closing_unknown, link.OBSTACLES_UNKNOWN);
  link = nearest_after(1.1, 0.0);
  EXPECT_EQ(link.closing_unknown, 0) << "none has come any more";
  EXPECT_EQ(link.closing_speed_obstacles, 0.0);
}

// The parts add up, and the report keeps them.
TEST_F(Cycle, SaysWhereItsTimeGoes) {
  see_wall(0.1F);
  boost::shared_ptr<ProximityArray> message;
  for (int i = 0; i < 10; ++i) step(&message);
  EXPECT_GT(message->query_time, 0.0);
  EXPECT_GT(message->repulsion_time, 0.0);
  EXPECT_GT(message->penetration_time, 0.0);
  EXPECT_DOUBLE_EQ(message->query_time + message->repulsion_time + message->penetration_time +
                       message->message_time,
                   message->computation_time);
  EXPECT_GT(report_.parts[kPartQuery].quantile(0.5), 0.0);
}

// Whatever time is left, every link has an answer, repulsion is finite and the status says what was
// left.
TEST_F(Cycle, EndsAtItsDeadline) {
  see_wall(0.1F);
  boost::shared_ptr<ProximityArray> message;
  for (const double deadline : {1e-9, 1e-5, 1e-4, 10.0}) {
    live_.query.deadline = deadline;
    for (int i = 0; i < 50; ++i) {
      step(&message);
      std::size_t wide = 0;
      for (const auto& link : message->links) {
        if (link.state == link.UNKNOWN) {
          ++wide;
          continue;
        }
        EXPECT_TRUE(std::isfinite(link.repulsion.x)) << link.link;
        if (link.state != link.CLEAR && link.distance - link.lower_bound > 0.001 + 2e-6) ++wide;
      }
      EXPECT_EQ(message->unfinished, wide);
      if (message->status != ProximityArray::OK) {
        EXPECT_EQ(message->status, ProximityArray::DEGRADED);
        EXPECT_NE(message->status_text.find("~query/deadline"), std::string::npos);
      } else {
        EXPECT_EQ(wide, 0U);
      }
    }
  }
  EXPECT_EQ(message->status, ProximityArray::OK);
  EXPECT_GT(report_.worst_deadline.unblended, 0U);
  EXPECT_GT(report_.deadlines_missed, 50U);
}

// Wherever in the cycle the deadline passes, repulsion does not turn: what is late keeps the last
// blend. Once that is older than RepulsionFilter::kHoldTime it is not known.
TEST_F(Cycle, LateRepulsionDoesNotTurn) {
  see_wall(0.1F);
  live_.query.deadline = 1e4;  // so that the count alone decides
  boost::shared_ptr<ProximityArray> message;
  step(&message);
  ASSERT_EQ(message->status, ProximityArray::OK) << message->status_text;
  std::vector<Eigen::Vector3d> last(message->links.size(), Eigen::Vector3d::Zero());
  std::size_t late = 0, compared = 0;
  double largest = 0.0;
  for (int i = 0; i < 300; ++i) {
    Deadline::asks_left_for_test = i % 3 == 0 ? -1 : 37 * i % 200;
    see_wall(0.1F);  // nothing is kept from the cycle before
    step(&message);
    Deadline::asks_left_for_test = -1;
    late += report_.worst_deadline.unblended > 0 ? 1 : 0;
    report_.worst_deadline = DeadlineCost();
    for (std::size_t k = 0; k < last.size(); ++k) {
      const auto& link = message->links[k];
      const Eigen::Vector3d push(link.repulsion.x, link.repulsion.y, link.repulsion.z);
      if (push.norm() > 1e-3 && last[k].norm() > 1e-3) {
        ++compared;
        largest = std::max(largest, std::acos(std::min(1.0, push.normalized().dot(last[k]))));
      }
      last[k] = push.norm() > 1e-3 ? push.normalized() : Eigen::Vector3d::Zero();
    }
  }
  EXPECT_GT(late, 0U);
  EXPECT_GT(compared, 300U);
  EXPECT_LT(largest, 0.01) << "1e-4 rad of each joint in a step";

  std::size_t known = 0;
  std::vector<int> held(message->links.size(), 0);
  for (int i = 0; i < 300; ++i) {
    live_.query.deadline = 1e-9;
    see_wall(0.1F);
    step(&message);
    EXPECT_EQ(message->status, ProximityArray::DEGRADED);
    for (std::size_t k = 0; k < held.size(); ++k) {
      const auto& link = message->links[k];
      const bool is_held = std::isfinite(link.repulsion.x) && link.repulsion.x != 0.0;
      held[k] = is_held ? held[k] + 1 : 0;
      known += is_held ? 1 : 0;
      EXPECT_LE(held[k], 1e3 * RepulsionFilter::kHoldTime + 1.0) << link.link;
    }
  }
  EXPECT_GT(known, 100);
}

}  // namespace
}  // namespace ist
