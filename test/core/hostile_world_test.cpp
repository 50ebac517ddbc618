// Known worlds under attack: margins of every size, objects that come, go and change their shape,
// frames that move, ranges that change, deadlines, and meshes that no one should send.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "internal/proximity/deadline.h"
#include "ist_proximity/proximity/known_world.h"
#include "ist_proximity/proximity/world_file.h"
#include "ist_proximity/proximity/world_query.h"
#include "support/meshes.h"
#include "support/random_links.h"
#include "support/random_numbers.h"
#include "support/sanitizers.h"
#include "support/scene.h"
#include "support/world_oracle.h"
#include "support/worlds.h"

namespace ist {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// A world that changes from step to step, and its truth.
class ChangingWorld {
 public:
  explicit ChangingWorld(std::uint64_t seed) : rng(seed), links(test::random_links(&rng)) {
    for (const LinkGeometry& shape : test::random_links(&rng)) {
      shapes_.push_back(shape);
      oracles_.emplace_back(shape);
    }
    for (const LinkGeometry& link : links) link_oracles_.emplace_back(link);
  }

  double uniform(double low, double high) { return test::uniform(&rng, low, high); }

  // Something comes, goes, or moves in its frame, and the frames move.
  void change(int step) {
    if (step % 3 == 0) add();
    if (step % 5 == 4) remove();
    if (step % 7 == 6) move();
    const double size = step % 4 == 0 ? uniform(0, 0.5) : 1e-3;
    for (auto& X : X_FB_) X = X * test::random_pose(&rng, size);
  }

  // Adds or replaces one of a few names.
  void add() {
    WorldObject object;
    object.name = "object " + std::to_string(static_cast<int>(uniform(0, 12)));
    object.frame = "frame " + std::to_string(static_cast<int>(uniform(0, 4)));
    const auto shape = static_cast<std::size_t>(uniform(0, 0.999) * shapes_.size());
    object.geometry = shapes_[shape];
    object.X_BO = test::random_pose(&rng, 1.0);
    object.margin = uniform(0, 1) < 0.5 ? 0.0 : std::pow(uniform(0, 1), 3);
    ASSERT_TRUE(builder_.add({object}).empty());
    Known& known = known_[object.name];
    known = {shape, object.frame, object.X_BO, object.margin};
    is_changed_ = true;
  }
  void remove() {
    if (known_.empty()) return;
    const auto one = std::next(
        known_.begin(), static_cast<long>(uniform(0, 0.999) * static_cast<double>(known_.size())));
    EXPECT_TRUE(builder_.remove(one->first));
    known_.erase(one);
    is_changed_ = true;
  }
  void move() {
    if (known_.empty()) return;
    auto& [name, known] = *known_.begin();
    known.X_BO = known.X_BO * test::random_pose(&rng, uniform(0, 0.3));
    EXPECT_EQ(builder_.move(name, known.frame, known.X_BO), "");
    is_changed_ = true;
  }

  const PosedWorld& posed() {
    if (is_changed_) posed_.world = builder_.world();
    is_changed_ = false;
    posed_.X_FB.clear();
    for (const std::string& frame : posed_.world->frames()) {
      posed_.X_FB.push_back(X_FB_[static_cast<std::size_t>(frame.back() - '0')]);
    }
    return posed_;
  }

  /// [m] The least distance less its margin; contact counts as 0.
  double truth(std::size_t link, const Eigen::Isometry3d& X_FL) const {
    double best = kInf;
    for (const auto& entry : known_) {
      const Known& known = entry.second;
      const Eigen::Isometry3d X_FO =
          X_FB_[static_cast<std::size_t>(known.frame.back() - '0')] * known.X_BO;
      const double distance =
          link_oracles_[link].distance(oracles_[known.shape], X_FL.inverse() * X_FO, 1e9);
      best = std::min(best, std::max(distance, 0.0) - known.margin);
    }
    return best;
  }
  bool empty() const { return known_.empty(); }

  test::Rng rng;
  std::vector<LinkGeometry> links;

 private:
  struct Known {
    std::size_t shape;
    std::string frame;
    Eigen::Isometry3d X_BO;
    double margin;
  };
  std::vector<LinkGeometry> shapes_;
  std::vector<test::OracleSolid> oracles_, link_oracles_;
  WorldBuilder builder_;
  std::map<std::string, Known> known_;
  std::vector<Eigen::Isometry3d> X_FB_ =
      std::vector<Eigen::Isometry3d>(4, Eigen::Isometry3d::Identity());
  PosedWorld posed_;
  bool is_changed_ = true;
};

double often_zero(test::Rng* rng, double probability, double most) {
  return test::chance(rng, probability) ? 0.0 : test::uniform(rng, 0.0, most);
}

QueryConfig random_config(test::Rng* rng) {
  QueryConfig config;
  config.max_distance = test::power_of_ten(rng, -2.0, 0.3);
  config.tolerance = test::chance(rng, 0.3) ? 0.0 : 0.002;
  config.relative_tolerance = test::chance(rng, 0.7) ? 0.0 : 0.2;
  config.margin = often_zero(rng, 0.7, 0.2);
  return config;
}

struct Answers {
  int all = 0, clear = 0, near = 0, unfinished_queries = 0;

  void expect(const LinkProximity& r, double truth, double max_distance, bool has_deadline) {
    ASSERT_LE(r.lower_bound, truth + 1e-9);
    if (!has_deadline) ASSERT_NE(r.state, LinkState::kUnknown);
    if (r.state == LinkState::kClear) ASSERT_GE(truth, max_distance - 1e-9);
    ++all;
    clear += r.state == LinkState::kClear ? 1 : 0;
    near += r.state == LinkState::kNear ? 1 : 0;
  }
};

// The links move, and so does what the query is asked for.
void expect_step(ChangingWorld* world, int step, std::vector<Eigen::Isometry3d>* X_FL,
                 WorldQuery* query, Answers* answers) {
  test::Rng* rng = &world->rng;
  world->change(step);
  for (auto& X : *X_FL) X = X * test::random_pose(rng, test::power_of_ten(rng, -5, -0.7));
  const QueryConfig config = random_config(rng);
  query->set_config(config);
  std::vector<double> margins;
  for (std::size_t i = 0; i < X_FL->size(); ++i) margins.push_back(often_zero(rng, 0.7, 0.3));
  query->set_link_margins(margins);
  query->set_influence_distance(often_zero(rng, 0.5, 0.5));
  const bool has_deadline = step % 6 == 5;
  const PosedWorld& posed = world->posed();
  if (has_deadline) Deadline::asks_left_for_test = static_cast<int>(world->uniform(0, 30));
  const TimePoint end =
      has_deadline ? std::chrono::steady_clock::now() + std::chrono::hours(1) : TimePoint::max();
  std::vector<LinkProximity> results;
  const std::vector<bool> known(X_FL->size(), true);
  const bool complete = query->run(*X_FL, known, {&posed}, end, &results);
  Deadline::asks_left_for_test = -1;
  ASSERT_TRUE(complete || has_deadline);
  answers->unfinished_queries += complete ? 0 : 1;
  for (std::size_t i = 0; i < X_FL->size(); ++i) {
    const double truth = world->truth(i, (*X_FL)[i]) - config.margin - margins[i];
    SCOPED_TRACE(::testing::Message() << "link " << i << ", deadline " << has_deadline);
    answers->expect(results[i], truth, config.max_distance, has_deadline);
  }
}

TEST(HostileWorld, NoBoundIsAboveTheTruthWhateverComesAndGoes) {
  Answers answers;
  for (const std::uint64_t seed : {7U, 8U}) {
    ChangingWorld world(seed);
    WorldQuery query(make_robot_surfaces(test::model_of(world.links, 0.02)), {});
    std::vector<Eigen::Isometry3d> X_FL(world.links.size());
    for (auto& X : X_FL) X = test::random_pose(&world.rng, 1.0);
    for (int step = 0; step < test::scaled(100); ++step) {
      SCOPED_TRACE(::testing::Message() << "seed " << seed << ", step " << step);
      expect_step(&world, step, &X_FL, &query, &answers);
      if (HasFatalFailure()) return;
    }
  }
  if (test::kSanitized) return;  // too few cases to count
  EXPECT_GT(answers.clear, answers.all / 20);
  EXPECT_GT(answers.near, answers.all / 5);
  EXPECT_GT(answers.unfinished_queries, 0);
}

// The answer for a ball of 0.05 m in one place.
LinkProximity answer_at(const Eigen::Vector3d& p_F, const QueryConfig& config,
                        const PosedWorld& world) {
  WorldQuery query(make_robot_surfaces(test::make_model({Sphere{0.05}}, 0.005)), config);
  const Eigen::Isometry3d X_FL(Eigen::Translation3d{p_F});
  std::vector<LinkProximity> results;
  EXPECT_TRUE(query.run({X_FL}, {true}, {&world}, TimePoint::max(), &results));
  return results.at(0);
}

// Whatever is sent is in the world, or there is a fault that names it: nothing is lost in silence.
TEST(HostileWorld, EveryObjectIsThereOrNamed) {
  const auto mesh = [](std::vector<Eigen::Vector3d> vertices,
                       std::vector<TriangleMesh::Triangle> triangles) {
    return Shape(TriangleMesh{std::move(vertices), std::move(triangles)});
  };
  const TriangleMesh good = test::icosphere(0.1, 1);
  TriangleMesh flat = good, tiny = good, huge = good, mirrored = good, doubled = good, far = good;
  for (auto& v : flat.vertices) v.z() = 0.0;
  for (auto& v : tiny.vertices) v *= 1e-12;
  for (auto& v : huge.vertices) v *= 1e9;
  for (auto& v : far.vertices) v.array() += 1e8;
  for (auto& t : mirrored.triangles) std::swap(t[0], t[1]);
  doubled.triangles.insert(doubled.triangles.end(), good.triangles.begin(), good.triangles.end());
  const std::vector<Shape> shapes = {mesh({}, {}),
                                     mesh({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {}),
                                     mesh({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 7}}),
                                     mesh({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 0xFFFFFFFF}}),
                                     mesh({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 0, 0}}),
                                     mesh({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}, {{0, 1, 2}}),
                                     mesh({{0, 0, 0}, {kNaN, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}),
                                     mesh({{0, 0, 0}, {kInf, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}),
                                     mesh({{0, 0, 0}, {1e-200, 0, 0}, {0, 1e-200, 0}}, {{0, 1, 2}}),
                                     mesh({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}),
                                     flat,
                                     tiny,
                                     huge,
                                     far,
                                     mirrored,
                                     doubled,
                                     Box{{0, 0, 0}},
                                     Box{{1, 1, 0}},
                                     Box{{-1, 1, 1}},
                                     Box{{kNaN, 1, 1}},
                                     Box{{1e300, 1, 1}},
                                     Box{{1e-300, 1e-300, 1e-300}},
                                     Sphere{0},
                                     Sphere{-1},
                                     Sphere{kInf},
                                     Sphere{1e-310},
                                     Cylinder{0, 1},
                                     Cylinder{1, 0},
                                     Cylinder{kNaN, 1},
                                     Cylinder{1e-9, 1e4},
                                     Cylinder{1e4, 1e-9}};
  WorldBuilder builder;
  std::set<std::string> named;
  std::vector<WorldObject> objects;
  for (std::size_t i = 0; i < shapes.size(); ++i) {
    objects.push_back(test::object_of("object " + std::to_string(i), test::one(shapes[i])));
  }
  for (const WorldFault& fault : builder.add(objects)) {
    EXPECT_TRUE(named.insert(fault.object).second) << fault.object;
    EXPECT_NE(fault.text.find(fault.object), std::string::npos) << fault.text;
  }
  std::set<std::string> there;
  const auto world = builder.world();
  for (const auto& object : world->objects()) there.insert(object.name);
  for (std::size_t i = 0; i < objects.size(); ++i) {
    EXPECT_NE(there.count(objects[i].name), named.count(objects[i].name)) << objects[i].name;
  }
  EXPECT_GE(there.size(), 4U);
  EXPECT_GE(named.size(), 15U);
  // What is there has distances.
  QueryConfig config;
  config.max_distance = 2.0;
  for (const WorldObject& object : objects) {
    if (there.count(object.name) == 0) continue;
    const LinkProximity r = answer_at({0.03, 0.02, 0.6}, config, test::posed({object}));
    EXPECT_NE(r.state, LinkState::kUnknown) << object.name;
    EXPECT_FALSE(std::isnan(r.lower_bound)) << object.name;
    EXPECT_LT(r.lower_bound, 0.7) << object.name << ": " << r.lower_bound;
  }
}

// 0.4 + 0.3 - 0.3 is less than 0.4: an object whose margin of 0.3 m ends outside of max_distance
// was neither clear nor near, and its link UNKNOWN.
TEST(HostileWorld, AMarginThatRoundsMaxDistanceDownLeavesTheLinkClear) {
  QueryConfig config;
  config.max_distance = 0.4;
  int cut = 0;
  for (int i = 1; i < 60; ++i) {
    WorldObject object = test::object_of("box", test::one(Box{{0.1, 0.1, 0.1}}));
    object.margin = 0.01 * i;
    cut += config.max_distance + object.margin - object.margin < config.max_distance ? 1 : 0;
    const double x = 0.1 + config.max_distance + object.margin + 0.005;
    const LinkProximity r = answer_at({x, 0.1, 0.0}, config, test::posed({object}));
    EXPECT_EQ(r.state, LinkState::kClear) << "margin " << object.margin;
    EXPECT_EQ(r.lower_bound, config.max_distance);
  }
  EXPECT_GT(cut, 0);
}

// Two objects of one name in a file: the second would take the place of the first, in silence.
TEST(HostileWorld, AFileThatNamesAnObjectTwiceIsRefused) {
  const std::string box = "1\nbox\n1 1 1\n0 0 0\n0 0 0 1\n0 0 0 0\n";
  const SceneFile scene =
      parse_scene("scene\n* wall\n" + box + "* table\n" + box + "* wall\n" + box + ".\n", "world");
  EXPECT_TRUE(scene.objects.empty());
  EXPECT_NE(scene.fault.find("'wall'"), std::string::npos) << scene.fault;
  EXPECT_NE(scene.fault.find("line "), std::string::npos) << scene.fault;
}

// A sphere took 36 ms to build, so that ten thousand of them kept the source busy for six minutes,
// and again each time that they were sent. Equal geometry is built once; objects that differ in one
// bit of it, or in their margin or pose alone, are objects of their own.
TEST(HostileWorld, ObjectsOfEqualGeometryShareIt) {
  const auto ball = [](const std::string& name, double radius, double x) {
    WorldObject object = test::object_of(name, test::one(Sphere{radius}));
    object.X_BO.translation().x() = x;
    return object;
  };
  std::vector<WorldObject> objects;
  for (int i = 0; i < 2000; ++i) objects.push_back(ball("ball " + std::to_string(i), 0.1, 0.3 * i));
  objects.push_back(ball("larger", std::nextafter(0.1, 1.0), -1.0));
  objects.push_back(ball("shifted", 0.1, -2.0));
  objects.back().geometry[0].X_LE.translation().y() = 0.25;
  objects.push_back(ball("mesh", 0.1, -3.0));
  objects.back().geometry[0].shape = test::icosphere(0.1, 1);
  objects.push_back(objects.back());
  objects.back().name = "other mesh";
  std::get<TriangleMesh>(objects.back().geometry[0].shape).vertices[3].x() += 1e-9;
  WorldBuilder builder;
  ASSERT_TRUE(builder.add(objects).empty());
  std::set<const WorldShape*> shapes;
  std::set<std::uint64_t> ids;
  const auto world = builder.world();
  for (const KnownWorld::Object& object : world->objects()) {
    shapes.insert(object.shape.get());
    ids.insert(object.id);
  }
  EXPECT_EQ(shapes.size(), 5U);
  EXPECT_EQ(ids.size(), objects.size());
  // What is sent again, also after all has been removed while a world holds it, is not built again.
  builder.clear();
  ASSERT_TRUE(builder.add(objects).empty());
  const auto again = builder.world();
  for (const KnownWorld::Object& object : again->objects()) {
    EXPECT_EQ(shapes.count(object.shape.get()), 1U);
    EXPECT_EQ(ids.count(object.id), 0U) << "bounds of the object of before must not be taken";
  }
  // Objects that share a shape are still measured where each of them is.
  QueryConfig config;
  config.max_distance = 0.5;
  WorldQuery query(make_robot_surfaces(test::make_model({Box{{0.1, 0.1, 0.1}}}, 0.005)), config);
  PosedWorld posed{again, {Eigen::Isometry3d::Identity()}};
  std::vector<LinkProximity> results;
  for (int i = 0; i < 20; ++i) {
    Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();
    X_FL.translation() = Eigen::Vector3d(0.3 * i, 0.4, 0.0);
    ASSERT_TRUE(query.run(std::vector<Eigen::Isometry3d>{X_FL}, {true}, {&posed}, TimePoint::max(),
                          &results));
    EXPECT_NEAR(results[0].distance, 0.25, 1e-9);
    EXPECT_EQ(again->objects()[static_cast<std::size_t>(results[0].point)].name,
              "ball " + std::to_string(i));
  }
  // A geometry that cannot be built is a fault of each object that has it.
  std::vector<WorldObject> bad = {ball("a", 0.1, 0), ball("b", 0.1, 0), ball("good", 0.1, 0)};
  TriangleMesh flat;
  flat.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};  // and no triangle
  bad[0].geometry[0].shape = bad[1].geometry[0].shape = flat;
  WorldBuilder other;
  const std::vector<WorldFault> faults = other.add(bad);
  ASSERT_EQ(faults.size(), 2U);
  EXPECT_EQ(faults[0].object, "a");
  EXPECT_EQ(faults[1].object, "b");
  EXPECT_TRUE(other.contains("good"));
}

}  // namespace
}  // namespace ist
