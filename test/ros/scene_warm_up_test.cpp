// The first answer with a new cloud, made beside the cycle.

#include "ros/cycle/scene_warm_up.h"

#include <gtest/gtest.h>
#include <ist_proximity/ProximityArray.h>
#include <ros/time.h>

#include <atomic>
#include <memory>
#include <thread>
#include <vector>

#include "ist_proximity/repulsion/repulsion.h"
#include "ros/cycle/proximity_cycle.h"
#include "support/allocations.h"
#include "support/cycle_parts.h"
#include "support/scene.h"

namespace ist {
namespace {

using ist_proximity::ProximityArray;

// A plane of points, `height` [m] above the origin.
CloudSnapshot plane(double height) {
  std::vector<Eigen::Vector3d> points;
  for (int i = -40; i <= 40; ++i) {
    for (int k = -40; k <= 40; ++k) points.emplace_back(0.01 * i, 0.01 * k, height);
  }
  return test::make_snapshot(points);
}

class SceneWarmUpTest : public ::testing::Test {
 protected:
  SceneWarmUpTest()
      : robot_(test::make_model({Box{{0.1, 0.2, 0.3}}, Sphere{0.1}}, 0.01)), warm_up_(sources_) {
    ros::Time::init();
    for (test::StatedSource** source : {&first_, &second_}) {
      auto stated = std::make_unique<test::StatedSource>("camera");
      *source = stated.get();
      *stated->cloud(ros::Time(1.0)) = plane(1.0);
      sources_.push_back(std::move(stated));
    }
    scene_.request.model = robot_;
    scene_.sources = {0, 1};
    scene_.X_FL.assign(2, Eigen::Isometry3d::Identity());
    scene_.known.assign(2, true);
    own_ = queries();
  }

  std::unique_ptr<CoherentQueries> queries() const {
    return std::make_unique<CoherentQueries>(robot_, QueryConfig());
  }
  const CloudSnapshot& cloud(test::StatedSource* source) const {
    return source->newest(scene_.request)->cloud;
  }
  std::uint64_t key(const CloudSnapshot& first) const {
    return obstacles_key({&first, &cloud(second_)});
  }

  std::shared_ptr<RobotModel> robot_;
  CloudSources sources_;
  test::StatedSource *first_ = nullptr, *second_ = nullptr;
  SceneWarmUp warm_up_;
  AskedScene scene_;
  std::unique_ptr<CoherentQueries> own_;
};

TEST_F(SceneWarmUpTest, ExchangesForTheCloudsThatItIsWarmFor) {
  auto spare = queries();
  CoherentQueries* const first = own_.get();
  CoherentQueries* const second = spare.get();
  warm_up_.begin(std::move(spare));
  warm_up_.note(scene_);
  SourceSnapshot fresh;
  fresh.cloud = plane(0.9);
  EXPECT_GT(warm_up_.run(*first_, fresh), 0.0);
  // The last cloud is not the fresh one.
  EXPECT_FALSE(warm_up_.exchange(key(cloud(first_)), &own_));
  EXPECT_EQ(own_.get(), first);
  EXPECT_TRUE(warm_up_.exchange(key(fresh.cloud), &own_));
  EXPECT_EQ(own_.get(), second);
  // The other ones are not warm for it.
  EXPECT_FALSE(warm_up_.exchange(key(fresh.cloud), &own_));
  EXPECT_EQ(own_.get(), second);
  // What was proven stands.
  std::vector<LinkProximity> results;
  own_->query().run(scene_.X_FL, scene_.known, {&fresh.cloud, &cloud(second_)}, &results);
  EXPECT_EQ(own_->query().statistics().exact_evaluations, 0U);
  EXPECT_NEAR(results[0].distance, 0.75, 0.002);
}

// A map's cloud is the reader's own copy.
class PlacedSource : public test::StatedSource {
 public:
  using test::StatedSource::StatedSource;
  std::shared_ptr<const SourceSnapshot> share(const SnapshotRequest& request) override {
    return std::make_shared<const SourceSnapshot>(*test::StatedSource::share(request));
  }
};

TEST_F(SceneWarmUpTest, KeyOfACloudThatIsPlacedForItIsThatOfTheCycle) {
  auto map = std::make_unique<PlacedSource>("map");
  *map->cloud(ros::Time(1.0)) = plane(1.0);
  second_ = map.get();
  sources_[1] = std::move(map);
  warm_up_.begin(queries());
  warm_up_.note(scene_);
  SourceSnapshot fresh;
  fresh.cloud = plane(0.9);
  EXPECT_GT(warm_up_.run(*first_, fresh), 0.0);
  EXPECT_TRUE(warm_up_.exchange(key(fresh.cloud), &own_));
}

TEST_F(SceneWarmUpTest, DoesNothingForASourceWithoutPart) {
  warm_up_.begin(queries());
  scene_.sources = {1};
  warm_up_.note(scene_);
  SourceSnapshot fresh;
  fresh.cloud = plane(0.9);
  EXPECT_EQ(warm_up_.run(*first_, fresh), 0.0);
  EXPECT_FALSE(warm_up_.exchange(key(fresh.cloud), &own_));
}

TEST_F(SceneWarmUpTest, DoesNothingBeforeACycleAndAfterTheEnd) {
  SourceSnapshot fresh;
  fresh.cloud = plane(0.9);
  EXPECT_EQ(warm_up_.run(*first_, fresh), 0.0);  // no model
  warm_up_.begin(queries());
  EXPECT_EQ(warm_up_.run(*first_, fresh), 0.0);  // no cycle
  warm_up_.note(scene_);
  EXPECT_GT(warm_up_.run(*first_, fresh), 0.0);
  warm_up_.begin(queries());  // another model
  EXPECT_FALSE(warm_up_.exchange(key(fresh.cloud), &own_));
  EXPECT_EQ(warm_up_.run(*first_, fresh), 0.0);
  warm_up_.begin(nullptr);
  warm_up_.note(scene_);
  EXPECT_EQ(warm_up_.run(*first_, fresh), 0.0);
  warm_up_.begin(queries());
  warm_up_.note(scene_);
  warm_up_.end();
  EXPECT_EQ(warm_up_.run(*first_, fresh), 0.0);
}

// Neither a steady cycle nor the one that exchanges allocates.
TEST_F(SceneWarmUpTest, CyclesAllocateNothing) {
  auto poses = std::make_unique<test::StatedPoses>();
  poses->set(scene_.X_FL);
  ProximityCycle cycle(test::ready_model(robot_), ServerConfig(), std::move(poses),
                       CloudSelection::Reader::kOnly);
  LiveConfig live;
  live.query.deadline = 0.0;
  ros::Time now(100.0);
  ProximityArray message;
  for (int i = 0; i < 100; ++i) {
    now += ros::Duration(0.001);
    CloudSnapshot* const cloud = first_->cloud(now);
    second_->cloud(now);
    const bool is_new = i > 0 && i % 10 == 0;
    if (is_new) {
      *cloud = plane(0.4 + 0.002 * i);
      SourceSnapshot fresh;
      fresh.cloud = std::move(*cloud);
      EXPECT_GT(warm_up_.run(*first_, fresh), 0.0);
      *cloud = std::move(fresh.cloud);
    }
    const long before = test::allocations;
    cycle.set_warm_up(&warm_up_);
    cycle.run(now, sources_, live, "", &message);
    const long count = test::allocations - before;
    ASSERT_EQ(message.status, ProximityArray::OK) << message.status_text;
    if (i > 20) {
      EXPECT_EQ(count, 0) << (is_new ? "with a new cloud" : "steady") << ", cycle " << i;
    }
  }
}

// Cycles go on while a source's thread warms up; each answer holds for its own cloud.
TEST_F(SceneWarmUpTest, CyclesNeverWaitAndAreRight) {
  sources_.pop_back();
  auto poses = std::make_unique<test::StatedPoses>();
  poses->set(scene_.X_FL);
  ProximityCycle cycle(test::ready_model(robot_), ServerConfig(), std::move(poses),
                       CloudSelection::Reader::kOnly);
  cycle.set_warm_up(&warm_up_);
  LiveConfig live;
  live.query.deadline = 0.0;
  live.repulsion.filter_time = 0.0;
  double height = 1.0, next_height = 0.0;
  SourceSnapshot fresh;
  std::atomic<bool> is_ready{false}, goes_on{true};
  int warm = 0;
  std::thread source([&] {
    for (int i = 0; goes_on; ++i) {
      if (is_ready) continue;
      next_height = 0.4 + 0.01 * (i % 50);
      fresh.cloud = plane(next_height);
      warm += warm_up_.run(*first_, fresh) > 0.0 ? 1 : 0;
      is_ready = true;
    }
  });
  ros::Time now(100.0);
  ProximityArray message;
  for (int images = 0; images < 100 && !HasFailure();) {
    now += ros::Duration(0.001);
    CloudSnapshot* const cloud = first_->cloud(now);
    if (is_ready) {
      *cloud = std::move(fresh.cloud);
      height = next_height;
      ++images;
      is_ready = false;
    }
    cycle.run(now, sources_, live, "", &message);
    EXPECT_EQ(message.status, ProximityArray::OK) << message.status_text;
    EXPECT_NEAR(message.links[0].distance, height - 0.15, 0.0011);
    EXPECT_LE(message.links[0].lower_bound, message.links[0].distance);
    EXPECT_GE(message.links[0].lower_bound, height - 0.15 - 0.0011);
    const bool is_pushed = message.links[0].distance < 0.3;  // the influence distance
    EXPECT_EQ(message.links[0].repulsion.z < 0.0, is_pushed);
  }
  goes_on = false;
  source.join();
  EXPECT_GT(warm, 90);
}

}  // namespace
}  // namespace ist
