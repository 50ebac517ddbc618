// Links against the objects of a known world, beside brute force.

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "internal/proximity/deadline.h"
#include "ist_proximity/proximity/world_query.h"
#include "ist_proximity/repulsion/object_repulsion.h"
#include "support/allocations.h"
#include "support/errors.h"
#include "support/random_links.h"
#include "support/sanitizers.h"
#include "support/scene.h"
#include "support/trial.h"
#include "support/world_oracle.h"
#include "support/worlds.h"

namespace ist {
namespace {

using test::at;
using test::expect_says;
using test::object_of;
using test::posed;

constexpr double kInf = std::numeric_limits<double>::infinity();

/// Random links and random objects, with their oracles.
struct Scene {
  test::Rng rng;
  std::vector<LinkGeometry> links, shapes;
  std::shared_ptr<const RobotModel> model;
  std::vector<test::OracleSolid> link_oracles, object_oracles;
  std::vector<bool> link_is_closed, object_is_closed;
  PosedWorld world;
  std::vector<Eigen::Isometry3d> X_FL;
  std::vector<bool> known;

  explicit Scene(std::uint64_t seed) : rng(seed) {
    links = test::random_links(&rng);
    shapes = test::random_links(&rng);
    model = test::model_of(links, 0.02);
    std::vector<WorldObject> objects;
    for (std::size_t i = 0; i < shapes.size(); ++i) {
      objects.push_back(object_of("object" + std::to_string(100 + i), shapes[i]));
      objects.back().frame = "frame" + std::to_string(100 + i);
    }
    world = posed(objects);
    for (const LinkGeometry& link : links) {
      link_oracles.emplace_back(link);
      link_is_closed.push_back(Solid(link).is_closed());
    }
    for (const LinkGeometry& shape : shapes) {
      object_oracles.emplace_back(shape);
      object_is_closed.push_back(Solid(shape).is_closed());
    }
    X_FL.resize(links.size());
    known.assign(links.size(), true);
  }

  void place(double size) {
    for (auto& X : X_FL) X = test::random_pose(&rng, size);
    for (auto& X : world.X_FB) X = test::random_pose(&rng, size);
  }

  /// [m] To the nearest object; 0 or less in contact.
  double truth(std::size_t link) const {
    double best = kInf;
    std::vector<std::pair<double, std::size_t>> order;  // the nearest origin first
    for (std::size_t i = 0; i < object_oracles.size(); ++i) {
      order.emplace_back((X_FL[link].translation() - world.X_FB[i].translation()).norm(), i);
    }
    std::sort(order.begin(), order.end());
    for (const auto& one : order) {
      const Eigen::Isometry3d X = X_FL[link].inverse() * world.X_FB[one.second];
      best = std::min(best, link_oracles[link].distance(object_oracles[one.second], X, best));
    }
    return best;
  }
};

// What holds of a link that is near an object.
void expect_near(const LinkProximity& r, const Eigen::Isometry3d& X_FL, double truth,
                 double tolerance, const std::string& what) {
  ASSERT_EQ(r.state, LinkState::kNear) << what;
  EXPECT_GE(r.distance, truth - 1e-9) << what;
  EXPECT_LE(r.distance, truth + tolerance + 1e-9) << what;
  if (r.lower_bound > 0.0) EXPECT_LE(r.distance - r.lower_bound, tolerance + 1e-9) << what;
  test::expect_witness(r, X_FL);
  EXPECT_EQ(r.source, 0) << what;
}

// The answers for a scene beside its truth.
struct Answers {
  int near = 0, contacts = 0, clear = 0, all = 0;

  void expect(const Scene& scene, std::size_t link, const LinkProximity& r,
              const QueryConfig& config, const std::string& place) {
    const double truth = scene.truth(link);
    const std::string what =
        "link " + std::to_string(link) + place + " truth " + std::to_string(truth);
    ++all;
    if (truth <= 0.0) {
      EXPECT_LE(r.lower_bound, 0.0) << what;
      contacts += r.state == LinkState::kContact ? 1 : 0;
      return;
    }
    if (r.distance <= 0.0) {  // a face inside, through a hole
      EXPECT_FALSE(scene.link_is_closed[link] && scene.object_is_closed[r.point]) << what;
      return;
    }
    EXPECT_LE(r.lower_bound, truth + 1e-9) << what;
    if (r.state == LinkState::kClear) {
      ++clear;
      EXPECT_GE(truth, config.max_distance - 1e-9) << what;
      return;
    }
    ++near;
    expect_near(r, scene.X_FL[link], truth, config.tolerance, what);
  }
};

TEST(WorldQuery, RandomLinksAndObjectsAgainstBruteForce) {
  Scene scene(41);
  const auto robot = make_robot_surfaces(scene.model);
  Answers answers;
  std::vector<LinkProximity> results;
  for (const double tolerance : {0.0, 0.001, 0.005}) {
    QueryConfig config;
    config.max_distance = 0.4;
    config.tolerance = tolerance;
    WorldQuery query(robot, config);
    for (int trial = 0; trial < test::scaled(140); ++trial) {
      scene.place(trial % 4 == 0 ? 0.5 : 1.2);
      ASSERT_TRUE(query.run(scene.X_FL, scene.known, {&scene.world}, TimePoint::max(), &results));
      for (std::size_t i = 0; i < scene.links.size(); ++i) {
        answers.expect(scene, i, results[i], config, " trial " + std::to_string(trial));
      }
      if (HasFailure()) return;
    }
  }
  if (test::kSanitized) return;
  EXPECT_GE(answers.all, 10000);
  EXPECT_GT(answers.near, 4000);
  EXPECT_GT(answers.contacts, 200);
  EXPECT_GT(answers.clear, 200);
}

// What holds of a kept answer beside a fresh one.
void expect_same(const LinkProximity& kept, const LinkProximity& anew, double tolerance,
                 const std::string& what) {
  if (kept.distance <= 0.0 && anew.distance <= 0.0) return;
  ASSERT_EQ(kept.state, anew.state) << what;
  if (anew.state != LinkState::kNear) return;
  ASSERT_NEAR(kept.distance, anew.distance, tolerance + 1e-11) << what;
  ASSERT_LE(kept.lower_bound, anew.distance + 1e-12) << what;
  ASSERT_LE(anew.lower_bound, kept.distance + 1e-12) << what;
}

// The answers along a motion are those of a fresh query at each step: objects move, links move.
TEST(WorldQuery, AMotionGivesTheAnswersOfFreshQueries) {
  Scene scene(42);
  const auto robot = make_robot_surfaces(scene.model);
  QueryConfig config;
  config.max_distance = 0.6;
  for (const double tolerance : {0.0, 0.001}) {
    config.tolerance = tolerance;
    WorldQuery kept(robot, config);
    std::vector<LinkProximity> from_kept, anew;
    scene.place(1.0);
    for (int step = 0; step < test::scaled(150); ++step) {
      for (std::size_t i = 0; i < scene.X_FL.size(); ++i) {
        const double sign = i % 2 == 0 ? 1.0 : -1.0;
        scene.X_FL[i].translation() += sign * Eigen::Vector3d(4e-4, -2e-4, 3e-4);
        scene.X_FL[i].linear() *= Eigen::AngleAxisd(1e-3, Eigen::Vector3d::UnitX()).matrix();
      }
      for (std::size_t i = 0; i < scene.world.X_FB.size(); i += 2) {
        scene.world.X_FB[i].translation() += Eigen::Vector3d(-3e-4, 5e-4, 1e-4);
      }
      kept.run(scene.X_FL, scene.known, {&scene.world}, TimePoint::max(), &from_kept);
      WorldQuery fresh(robot, config);
      fresh.run(scene.X_FL, scene.known, {&scene.world}, TimePoint::max(), &anew);
      for (std::size_t i = 0; i < anew.size(); ++i) {
        expect_same(from_kept[i], anew[i], tolerance,
                    "link " + std::to_string(i) + " step " + std::to_string(step));
        ASSERT_FALSE(HasFatalFailure());
      }
    }
  }
}

// A ball of 0.1 m at the origin, as the only link.
std::shared_ptr<const RobotSurfaces> ball() {
  return make_robot_surfaces(test::make_model({Sphere{0.1}}, 0.01));
}

LinkProximity answer_at(WorldQuery* query, const PosedWorld& world,
                        const Eigen::Isometry3d& X_FL = Eigen::Isometry3d::Identity()) {
  std::vector<LinkProximity> results;
  query->run({X_FL}, {true}, {&world}, TimePoint::max(), &results);
  return results[0];
}

LinkGeometry cube(double size) { return test::one(Box{{size, size, size}}); }

// The nearest object is named, though another one has the least bound by its margin.
TEST(WorldQuery, MarginsReduceTheLowerBoundAlone) {
  std::vector<WorldObject> objects = {object_of("near", cube(0.2), at(0.5, 0.0, 0.0)),
                                      object_of("wide", cube(0.2), at(-0.6, 0.0, 0.0))};
  objects[1].margin = 0.2;
  QueryConfig config;
  config.margin = 0.01;
  WorldQuery query(ball(), config);
  const PosedWorld world = posed(objects);
  LinkProximity r = answer_at(&query, world);
  EXPECT_NEAR(r.distance, 0.3, 1e-9);
  EXPECT_EQ(r.point, 0U);
  EXPECT_LE(r.lower_bound, 0.4 - 0.2 - 0.01 + 1e-9);
  EXPECT_GE(r.lower_bound, 0.3 - 0.2 - 0.01 - config.tolerance - 1e-9);
  query.set_link_margins({0.05});
  r = answer_at(&query, world);
  EXPECT_LE(r.lower_bound, 0.4 - 0.2 - 0.05 - 0.01 + 1e-9);
  EXPECT_NEAR(r.distance, 0.3, 1e-9);
}

// An object outside of the range whose margin reaches into it takes CLEAR away.
TEST(WorldQuery, AMarginReachesIntoTheRange) {
  std::vector<WorldObject> objects = {object_of("far", cube(0.2), at(1.3, 0.0, 0.0))};
  WorldQuery query(ball());
  EXPECT_EQ(answer_at(&query, posed(objects)).state, LinkState::kClear);
  objects[0].margin = 0.4;
  const LinkProximity r = answer_at(&query, posed(objects));
  EXPECT_EQ(r.state, LinkState::kNear);
  EXPECT_NEAR(r.distance, 1.1, 1e-9);
  EXPECT_NEAR(r.lower_bound, 0.7, 0.0011);
  // So far away that the sphere about the object and its neighbours is outside, too.
  objects[0].X_BO = at(1.8, 0.0, 0.0);
  EXPECT_EQ(answer_at(&query, posed(objects)).state, LinkState::kClear);
  objects[0].margin = 0.9;
  EXPECT_NEAR(answer_at(&query, posed(objects)).lower_bound, 0.7, 0.0011);
  objects[0] = object_of("far", cube(0.2), at(1.3, 0.0, 0.0));
  // The list of objects in range was made without the link's margin.
  WorldQuery other(ball());
  const PosedWorld world = posed(objects);
  EXPECT_EQ(answer_at(&other, world).state, LinkState::kClear);
  other.set_link_margins({0.4});
  EXPECT_NEAR(answer_at(&other, world).lower_bound, 0.7, 0.0011);
}

TEST(WorldQuery, AnAllowedContactIsNotMeasured) {
  std::vector<WorldObject> objects = {object_of("bench", cube(0.2)),
                                      object_of("wall", cube(0.2), at(0.0, 0.6, 0.0))};
  WorldQuery query(ball());
  EXPECT_EQ(answer_at(&query, posed(objects)).state, LinkState::kContact);
  objects[0].allowed_links = {"no such link", "link0"};
  const LinkProximity r = answer_at(&query, posed(objects));
  EXPECT_EQ(r.state, LinkState::kNear);
  EXPECT_NEAR(r.distance, 0.4, 1e-9);
  EXPECT_EQ(r.point, 1U);
}

TEST(WorldQuery, AWorldWithoutPosesIsNotKnown) {
  PosedWorld world = posed({object_of("wall", cube(0.2), at(5.0, 0.0, 0.0))});
  WorldQuery query(ball());
  for (const PosedWorld& known : {world, PosedWorld()}) {  // nothing is near, or there
    EXPECT_EQ(answer_at(&query, known).state, LinkState::kClear);
    EXPECT_EQ(answer_at(&query, known).lower_bound, 1.0);
  }
  PosedWorld unplaced = world;
  unplaced.X_FB.clear();
  EXPECT_EQ(answer_at(&query, unplaced).state, LinkState::kUnknown);
  world.X_FB[0].translation().x() = std::nan("");
  EXPECT_EQ(answer_at(&query, world).state, LinkState::kUnknown);
}

// Objects in a frame that is not known are left out; those in others are where they were.
TEST(WorldQuery, ObjectsOfSomeFrames) {
  WorldQuery query(ball());
  std::vector<WorldObject> objects = {object_of("near", cube(0.1), at(0.3, 0, 0)),
                                      object_of("far", cube(0.1), at(0.5, 0, 0))};
  objects[0].frame = "other";
  const PosedWorld whole = posed(objects);
  ASSERT_EQ(whole.world->frames().size(), 2U);
  EXPECT_NEAR(answer_at(&query, whole).distance, 0.15, 1e-9);
  PosedWorld rest = whole;
  rest.world = whole.world->in_frames(
      {whole.world->frames()[0] == "world", whole.world->frames()[1] == "world"});
  ASSERT_EQ(rest.world->objects().size(), 1U);
  EXPECT_EQ(rest.world->frames(), whole.world->frames());
  EXPECT_NEAR(answer_at(&query, rest).distance, 0.35, 1e-9);
  EXPECT_NEAR(answer_at(&query, whole).distance, 0.15, 1e-9);
}

// Every time at which a deadline may come leaves a bound that holds.
TEST(WorldQuery, EveryLinkHasABoundWhenTheTimeIsOver) {
  Scene scene(43);
  const auto robot = make_robot_surfaces(scene.model);
  QueryConfig config;
  config.max_distance = 0.6;
  config.tolerance = 0.0;
  WorldQuery exact(robot, config), hurried(robot, config);
  std::vector<LinkProximity> truth, answer;
  int unfinished = 0;
  for (int trial = 0; trial < test::scaled(100); ++trial) {
    if (trial % 5 == 0) scene.place(1.0);
    for (auto& X : scene.X_FL) X.translation() += test::random_vector(&scene.rng, 1e-3);
    exact.run(scene.X_FL, scene.known, {&scene.world}, TimePoint::max(), &truth);
    Deadline::asks_left_for_test = trial % 7;
    const TimePoint end = std::chrono::steady_clock::now() + std::chrono::hours(1);
    const bool all = hurried.run(scene.X_FL, scene.known, {&scene.world}, end, &answer);
    Deadline::asks_left_for_test = -1;
    EXPECT_EQ(all, hurried.statistics().unfinished == 0);
    unfinished += static_cast<int>(hurried.statistics().unfinished);
    for (std::size_t i = 0; i < truth.size(); ++i) {
      if (truth[i].distance <= 0.0) {
        EXPECT_LE(answer[i].lower_bound, 0.0) << i << " trial " << trial;
        continue;
      }
      EXPECT_LE(answer[i].lower_bound, truth[i].distance + 1e-12) << i << " trial " << trial;
      if (truth[i].state == LinkState::kNear && answer[i].state == LinkState::kNear)
        EXPECT_GE(answer[i].distance, truth[i].distance - 1e-12);
    }
  }
  if (!test::kSanitized) EXPECT_GT(unfinished, 100);
}

// A thousand balls in frames that move and turn, in groups, and a robot of two balls.
struct Balls {
  static constexpr double kMargin = 0.3;  // [m] the largest
  static constexpr double kPoses = 2e-6;  // [m] what poses that are rigid to 1e-6 leave open
  test::Rng rng{67};
  std::vector<WorldObject> objects;
  PosedWorld world;
  std::vector<std::string> frames;
  std::uint64_t near = 0;  // answers
  std::vector<double> radii = {0.1, 0.05};
  std::vector<Eigen::Isometry3d> X_FL = {at(0.5, 0.0, 0.0), at(-0.5, 0.3, 0.2)};

  Balls() {
    for (int i = 0; i < 1000; ++i) objects.push_back(ball(i));
    world = posed(objects);
    frames = world.world->frames();
    for (std::size_t f = 0; f < frames.size(); ++f) {
      if (is_pair(f)) world.X_FB[f].translation() = test::random_vector(&rng, 1.0);
    }
  }
  bool is_pair(std::size_t frame) const { return frames[frame].rfind("pair", 0) == 0; }

  WorldObject ball(int i) {
    const std::string number = std::to_string(i);
    const double radius = i % 250 == 0 ? 0.5 : 0.02 + 0.001 * (i % 5);
    WorldObject one = object_of("ball" + number, test::one(Sphere{radius}));
    one.geometry[0].X_LE.translation() = test::random_vector(&rng, 0.2);
    one.X_BO.translation() = test::random_vector(&rng, 4.0);
    const double angle = test::uniform(&rng, 0.0, 3.0);
    one.X_BO.rotate(Eigen::AngleAxisd(angle, test::random_vector(&rng, 1.0).normalized()));
    if (i % 7 == 0) one.X_BO.linear() *= 1.0 + 2e-7;
    one.frame = "frame" + std::to_string(i % 2);
    one.margin = i % 11 == 0 ? 0.15 : 0.0;
    if (i % 13 == 0) one.allowed_links = {"link1"};
    if (i % 250 == 0) {  // a large ball alone in its group
      one.frame = "ball" + number;
      one.X_BO.translation() = test::random_vector(&rng, 1.5);
      one.margin = kMargin;
    }
    if (i % 50 == 1 || i % 50 == 2) {  // two that turn about the middle of their group
      one.frame = "pair" + std::to_string(i / 50);
      one.X_BO.translation() = Eigen::Vector3d(i % 50 == 1 ? 1.0 : -1.0, 0.0, 0.0);
      one.geometry[0].X_LE.setIdentity();
    }
    return one;
  }

  void move(int step) {
    for (Eigen::Isometry3d& X : X_FL) X.translation() += test::random_vector(&rng, 0.01);
    for (std::size_t f = 0; f < world.X_FB.size(); ++f) {
      if (test::uniform(&rng, 0, 1) < 0.3) continue;
      const Eigen::AngleAxisd turn(is_pair(f) ? 0.1 : 0.002, Eigen::Vector3d(0.0, 0.6, 0.8));
      world.X_FB[f] = world.X_FB[f] * turn;
      world.X_FB[f].translation() += test::random_vector(&rng, 0.002);
      if (f == 1) world.X_FB[f].linear() = turn.matrix() * (1.0 + (step % 2) * 3e-7);
    }
  }

  // [m] To the nearest ball, and to the nearest less its margin.
  std::pair<double, double> truth(std::size_t link, bool may_touch) const {
    double truth = 1e9, proven = 1e9;
    for (const WorldObject& one : objects) {
      if (may_touch && !one.allowed_links.empty()) continue;
      const auto f = std::find(frames.begin(), frames.end(), one.frame) - frames.begin();
      const Eigen::Vector3d p_FO =
          world.X_FB[static_cast<std::size_t>(f)] * (one.X_BO * one.geometry[0].X_LE.translation());
      const double distance = (p_FO - X_FL[link].translation()).norm() - radii[link] -
                              std::get<Sphere>(one.geometry[0].shape).radius;
      truth = std::min(truth, distance);
      proven = std::min(proven, distance - one.margin);
    }
    return {truth, proven};
  }

  void expect(const LinkProximity& r, std::size_t link, bool may_touch, const QueryConfig& config) {
    const auto [distance, proven] = truth(link, may_touch);
    if (distance <= 0.0) {  // the depth of a point in both is another one
      ASSERT_LE(r.lower_bound, kPoses);
      return;
    }
    ASSERT_LE(r.lower_bound, proven + kPoses);
    if (proven > config.max_distance + kPoses) {
      ASSERT_EQ(r.state, LinkState::kClear);
    } else if (proven > 0.0) {
      const double least = std::min(proven, distance - kMargin);
      ASSERT_GE(r.lower_bound, least - config.tolerance - kPoses);
    }
    if (r.state != LinkState::kNear) return;
    ASSERT_GE(r.distance, distance - kPoses);
    ++near;
  }
};

// The groups are placed when a link comes near: the answers are those of all balls, in poses that
// are rigid to 1e-6 alone as well.
TEST(WorldQuery, GroupsOfObjectsLeaveNoneOut) {
  Balls balls;
  const auto model = test::make_model({Sphere{balls.radii[0]}, Sphere{balls.radii[1]}}, 0.005);
  std::vector<bool> may_touch;
  for (const LinkModel& link : model->links) may_touch.push_back(link.name == "link1");
  ASSERT_EQ(std::count(may_touch.begin(), may_touch.end(), true), 1);
  QueryConfig config;
  config.max_distance = 0.3;
  WorldQuery query(make_robot_surfaces(model), config);
  std::uint64_t placed = 0;
  const int steps = test::scaled(1500);
  for (int step = 0; step < steps; ++step) {
    balls.move(step);
    std::vector<LinkProximity> results;
    query.run(balls.X_FL, {true, true}, {&balls.world}, TimePoint::max(), &results);
    placed += query.statistics().objects_placed;
    for (std::size_t i = 0; i < results.size(); ++i) {
      balls.expect(results[i], i, may_touch[i], config);
      ASSERT_FALSE(HasFatalFailure()) << step;
    }
  }
  EXPECT_GT(balls.near, static_cast<std::uint64_t>(steps) / 4);
  EXPECT_GT(placed, 0U);
}

// Objects out of range come near in small steps while the link stands still.
TEST(WorldQuery, ObjectsThatComeIntoRangeAreFound) {
  PosedWorld world = posed({object_of("cart", cube(0.2))});
  WorldQuery query(ball());
  for (double x = 3.0; x > 0.4; x -= 0.02) {
    world.X_FB[0] = at(x, 0.0, 0.0);
    const LinkProximity r = answer_at(&query, world);
    const double truth = x - 0.1 - 0.1;
    EXPECT_EQ(r.state, truth < 1.0 ? LinkState::kNear : LinkState::kClear) << x;
    EXPECT_LE(r.lower_bound, std::max(truth, 1.0) + 1e-9);
    if (truth < 1.0) EXPECT_LE(r.lower_bound, truth + 1e-9);
  }
}

// More objects are near than searches are kept.
TEST(WorldQuery, ManyNearObjects) {
  std::vector<WorldObject> objects;
  test::Rng rng(44);
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector3d n = test::random_vector(&rng, 1.0).normalized();
    objects.push_back(object_of("object" + std::to_string(100 + i), cube(0.02), at(0.4 * n)));
  }
  const PosedWorld world = posed(objects);
  WorldQuery query(ball());
  query.set_influence_distance(0.5);
  for (int step = 0; step < 20; ++step) {
    const Eigen::Vector3d center = test::random_vector(&rng, 0.1);
    double truth = kInf;
    for (const auto& object : world.world->objects()) {
      const Eigen::Vector3d p = (center - object.X_BO.translation()).cwiseAbs();
      truth = std::min(truth, (p.array() - 0.01).max(0.0).matrix().norm() - 0.1);
    }
    const LinkProximity r = answer_at(&query, world, at(center));
    EXPECT_NEAR(r.distance, truth, 0.0011) << step;
    EXPECT_LE(r.lower_bound, truth + 1e-12) << step;
  }
}

// Between two walls the pushes cancel, and no step is larger than the motion allows.
TEST(WorldQuery, RepulsionOfObjectsIsContinuous) {
  const PosedWorld world = posed({object_of("left", cube(1.0), at(-0.8, 0.0, 0.0)),
                                  object_of("right", cube(1.0), at(0.8, 0.0, 0.0))});
  WorldQuery query(ball(), {});
  RepulsionConfig config;
  query.set_influence_distance(config.influence_distance);
  LinkProximity no_cloud;
  no_cloud.state = LinkState::kClear;
  Eigen::Vector3d last = Eigen::Vector3d::Zero();
  for (int i = -200; i <= 200; ++i) {
    const Eigen::Isometry3d X_FL = at(5e-4 * i, 0.0, 0.0);
    const LinkProximity r = answer_at(&query, world, X_FL);
    const Eigen::Vector3d push =
        with_objects(X_FL, {}, no_cloud, query.near_objects(0), r, config).force;
    EXPECT_LE(push.norm(), config.gain);
    if (i == 0) EXPECT_LT(push.norm(), 0.02);
    if (i == 200) EXPECT_NEAR(push.x(), -config.gain * (1.0 - 0.1 / 0.3), 0.02);
    if (i > -200) EXPECT_LT((push - last).norm(), 0.02) << i;
    last = push;
  }
  // A cloud that is nearer decides.
  LinkProximity cloud;
  cloud.state = LinkState::kNear;
  cloud.distance = 0.01;
  RepulsiveWrench of_cloud;
  of_cloud.force = Eigen::Vector3d(0.0, config.gain * (1.0 - 0.01 / 0.3), 0.0);
  const LinkProximity r = answer_at(&query, world);
  ASSERT_GT(r.distance, 0.01 + config.smoothing);
  const Eigen::Vector3d push =
      with_objects(at(0.0, 0.0, 0.0), of_cloud, cloud, query.near_objects(0), cloud, config).force;
  EXPECT_NEAR((push - of_cloud.force).norm(), 0.0, 1e-12);
  // A cloud's blend that is late is not known, and neither is what it counts in; far away it does
  // not. Nor is the push of objects that were not measured in time.
  const RepulsiveWrench late = RepulsiveWrench::unknown();
  const Eigen::Isometry3d origin = at(0.0, 0.0, 0.0);
  EXPECT_TRUE(
      with_objects(origin, late, cloud, query.near_objects(0), cloud, config).force.hasNaN());
  LinkProximity far = cloud;
  far.distance = r.distance + config.smoothing;
  EXPECT_TRUE(with_objects(origin, late, far, query.near_objects(0), r, config).force.allFinite());
  EXPECT_TRUE(with_objects(origin, {}, no_cloud, {}, r, config).force.hasNaN());
}

TEST(WorldQuery, AllocatesNothingWhileTheWorldIsTheSame) {
  Scene scene(45);
  WorldQuery query(make_robot_surfaces(scene.model));
  std::vector<LinkProximity> results;
  scene.place(0.6);
  query.run(scene.X_FL, scene.known, {&scene.world}, TimePoint::max(), &results);
  for (int trial = 0; trial < 20; ++trial) {
    scene.place(0.6);
    const long before = test::allocations;
    query.run(scene.X_FL, scene.known, {&scene.world}, TimePoint::max(), &results);
    EXPECT_EQ(test::allocations, before);
  }
}

// The only fault of what is added.
WorldFault only_fault(WorldBuilder* builder, const std::vector<WorldObject>& objects) {
  const auto faults = builder->add(objects);
  EXPECT_EQ(faults.size(), 1U);
  return faults.empty() ? WorldFault() : faults[0];
}

TEST(KnownWorld, KeepsToItsLimits) {
  WorldLimits limits;
  limits.max_objects = 3;
  limits.max_triangles = 30;
  WorldBuilder builder(limits);
  EXPECT_TRUE(builder.add({object_of("a", cube(0.1)), object_of("b", cube(0.1))}).empty());
  expect_says(only_fault(&builder, {object_of("c", cube(0.1))}).text,
              "36 triangles; allowed are 30");
  std::vector<WorldObject> many(100000, object_of("many", test::one(Sphere{0.1})));
  for (std::size_t i = 0; i < many.size(); ++i) many[i].name += std::to_string(i);
  expect_says(only_fault(&builder, many).text, "100002 objects; allowed are 3");
  EXPECT_EQ(builder.size(), 2U);
  const LinkGeometry compound(2, test::one(Sphere{0.1})[0]);
  expect_says(only_fault(&builder, {object_of("compound", compound)}).text,
              "4 shapes; allowed are 3");
  EXPECT_TRUE(builder.add({object_of("a", test::one(Sphere{0.1}))}).empty()) << "replaced";
  EXPECT_EQ(builder.size(), 2U);
}

TEST(KnownWorld, NamesWhatCannotBeUsed) {
  WorldObject margin = object_of("margin", cube(0.1)), frame = object_of("frame", cube(0.1));
  margin.margin = -1.0;
  frame.frame = "";
  for (const auto& [object, part] : std::initializer_list<std::pair<WorldObject, std::string>>{
           {object_of("huge", cube(2e4)), "'huge'"},
           {object_of("flat", test::one(Box{{1.0, 0.0, 1.0}})), "'flat'"},
           {object_of("empty", {}), "it has no shape"},
           {object_of("", cube(0.1)), "name"},
           {object_of("away", cube(0.1), at(2e4, 0.0, 0.0)), "its position"},
           {object_of("nan", cube(0.1), at(std::nan(""), 0.0, 0.0)), "its pose"},
           {margin, "its margin is -1 m"},
           {frame, "frame"},
           {object_of("mesh", test::one(TriangleMesh())), "'mesh'"}}) {
    WorldBuilder builder;
    const WorldFault fault = only_fault(&builder, {object_of("good", cube(0.1)), object});
    EXPECT_EQ(fault.object, object.name);
    expect_says(fault.text, part);
    EXPECT_EQ(builder.size(), 1U) << "the others go on";
  }
}

TEST(KnownWorld, MovesAndRemoves) {
  WorldBuilder builder;
  EXPECT_TRUE(builder.add({object_of("a", cube(0.2), at(0.5, 0.0, 0.0))}).empty());
  const auto first = builder.world();
  EXPECT_EQ(builder.move("a", "other", at(0.7, 0.0, 0.0)), "");
  EXPECT_NE(builder.move("b", "other", at(0.7, 0.0, 0.0)), "");
  EXPECT_NE(builder.move("a", "other", at(kInf, 0.0, 0.0)), "");
  const auto second = builder.world();
  EXPECT_EQ(first->objects()[0].id, second->objects()[0].id) << "its search is kept";
  EXPECT_EQ(second->frames()[0], "other");
  WorldQuery query(ball());
  EXPECT_NEAR(answer_at(&query, {first, {at(0.0, 0.0, 0.0)}}).distance, 0.3, 1e-9);
  EXPECT_NEAR(answer_at(&query, {second, {at(0.1, 0.0, 0.0)}}).distance, 0.6, 1e-9);
  EXPECT_TRUE(builder.remove("a"));
  EXPECT_FALSE(builder.remove("a"));
  EXPECT_EQ(answer_at(&query, {builder.world(), {}}).state, LinkState::kClear);
}

}  // namespace
}  // namespace ist
