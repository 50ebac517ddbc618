// Links against solid boxes: the leaves of an octree map.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <vector>

#include "internal/cloud/box_bvh.h"
#include "internal/geometry/box_distance.h"
#include "internal/geometry/solid_queries.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "support/box_oracle.h"
#include "support/box_truth.h"
#include "support/meshes.h"
#include "support/oracle.h"
#include "support/random_links.h"
#include "support/sanitizers.h"
#include "support/scene.h"

namespace ist {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(BoxDistance, TrianglesOfEveryKind) {
  test::Rng rng(31);
  int touching = 0, apart = 0;
  for (int i = 0; i < test::scaled(20000); ++i) {
    const Eigen::AlignedBox3d box(Eigen::Vector3d(-0.5, -0.3, -0.2),
                                  Eigen::Vector3d(0.5, 0.3, 0.2));
    const double size = std::pow(10.0, test::uniform(&rng, -3.0, 0.5));
    const Eigen::Vector3d middle = test::random_vector(&rng, 1.0);
    Eigen::Vector3d a = middle + test::random_vector(&rng, size), b, c;
    b = middle + test::random_vector(&rng, size);
    c = middle + test::random_vector(&rng, size);
    switch (i % 8) {
      case 0:  // along an axis
        b = a + size * Eigen::Vector3d::Unit(i % 3);
        break;
      case 1:  // parallel to a side
        b[i % 3] = c[i % 3] = a[i % 3];
        break;
      case 2:  // a needle
        c = a + 0.5 * (b - a) + test::random_vector(&rng, 1e-5 * size);
        break;
      case 3:  // no area
        c = a + test::uniform(&rng, -1, 2) * (b - a);
        break;
      case 4:  // on a corner or side
        a = clamp_to(box, a);
        break;
      default:
        break;
    }
    const BoxDistance found = triangle_to_box(a, b, c, box);
    const double truth =
        test::BoxOracle({{a, b, c}, {{0, 1, 2}}}).distance({box, Eigen::Isometry3d::Identity()});
    ASSERT_NEAR(found.distance, truth, 1e-7 * (1.0 + size)) << i;
    ASSERT_NEAR((found.p_OS - found.p_OB).norm(), found.distance, 1e-12);
    ASSERT_LT(box.exteriorDistance(found.p_OB), 1e-12);
    ASSERT_LT(test::oracle_triangle(found.p_OS, a, b, c), 1e-9 * (1.0 + size)) << i;
    found.distance == 0.0 ? ++touching : ++apart;
  }
  EXPECT_GT(touching, test::scaled(1000));
  EXPECT_GT(apart, test::scaled(1000));
}

std::vector<TriangleMesh> link_meshes() {
  return {test::l_shape(0.2, 0.05), test::torus(0.1, 0.03, 12, 8), test::box({0.05, 0.1, 0.2}),
          test::thin_plate(0.1, 0.001), test::icosphere(0.08, 1)};
}

class Boxes : public ::testing::TestWithParam<double> {};

TEST_P(Boxes, AgainstOracle) {
  const double tolerance = GetParam();
  test::Rng rng(34);
  const std::vector<TriangleMesh> meshes = link_meshes();
  const auto model = test::make_model({meshes.begin(), meshes.end()}, 0.005);
  QueryConfig config;
  config.tolerance = tolerance;
  config.max_distance = 0.3;
  ProximityQuery query(model, config);
  const std::vector<bool> known(meshes.size(), true);
  std::vector<LinkProximity> results;
  std::vector<Eigen::Isometry3d> X_FL(meshes.size());
  int clear = 0, near = 0, contact = 0, cases = 0;
  const int scenes = test::scaled(tolerance == 0.0 ? 500 : 100);
  for (int scene = 0; scene < scenes; ++scene) {
    const std::vector<Eigen::AlignedBox3d> boxes =
        test::random_leaves(&rng, 1 + scene % 25, 0.5, 0.02, 4);
    const CloudSnapshot map = test::make_map(boxes, test::random_pose(&rng, 0.3));
    for (int step = 0; step < 4; ++step) {  // later steps have a warm start
      for (Eigen::Isometry3d& X : X_FL) {
        X = step == 0 ? test::random_pose(&rng, 0.4)
                      : Eigen::Isometry3d(X * test::random_pose(&rng, 0.01));
      }
      ASSERT_TRUE(query.run(X_FL, known, {&map}, &results));
      for (std::size_t i = 0; i < meshes.size(); ++i, ++cases) {
        SCOPED_TRACE("scene " + std::to_string(scene) + " step " + std::to_string(step) + " link " +
                     std::to_string(i));
        const test::BoxTruth truth = test::truth_of(meshes[i], map, X_FL[i]);
        const LinkProximity& result = results[i];
        ASSERT_NO_FATAL_FAILURE(test::expect_truth(result, truth, meshes[i], map, X_FL[i], config));
        clear += result.state == LinkState::kClear;
        near += result.state == LinkState::kNear;
        if (result.state != LinkState::kContact) continue;
        ++contact;
        if (cases % 10 == 0) {
          ASSERT_LE(result.lower_bound, test::sampled_depth(&rng, meshes[i], map, X_FL[i], 200));
        }
      }
    }
  }
  EXPECT_GT(clear, scenes / 10);
  EXPECT_GT(near, scenes);
  EXPECT_GT(contact, test::kSanitized ? -1 : scenes / 10);
}

INSTANTIATE_TEST_SUITE_P(Tolerances, Boxes, ::testing::Values(0.0, 0.001, 0.02));

// Primitives, meshes with holes, compounds: bounds against many points of the boxes.
TEST(Boxes, EveryKindOfLink) {
  test::Rng rng(35);
  const std::vector<LinkGeometry> links = test::random_links(&rng);
  const auto model = test::model_of(links, 0.01);
  const std::vector<Solid> solids(links.begin(), links.end());
  QueryConfig config;
  config.tolerance = 0.0;
  ProximityQuery query(model, config);
  std::vector<LinkProximity> results;
  const std::vector<bool> known(links.size(), true);
  for (int scene = 0; scene < test::scaled(150); ++scene) {
    const std::vector<Eigen::AlignedBox3d> boxes = test::random_leaves(&rng, 4, 0.3, 0.01, 5);
    const CloudSnapshot map = test::make_map(boxes, test::random_pose(&rng, 0.2));
    const std::vector<Eigen::Isometry3d> X_FL(links.size(), test::random_pose(&rng, 0.1));
    query.run(X_FL, known, {&map}, &results);
    for (std::size_t i = 0; i < links.size(); ++i) {
      SCOPED_TRACE("scene " + std::to_string(scene) + " link " + std::to_string(i));
      const LinkProximity& result = results[i];
      ASSERT_GE(result.state, LinkState::kNear);
      ASSERT_NEAR(result.direction.norm(), 1.0, 1e-9);
      ASSERT_LT((result.p_FCl - result.p_FCo - result.distance * result.direction).norm(), 1e-9);
      ASSERT_TRUE(test::in_a_box(map, result.p_FCo));
      const Eigen::Isometry3d X_LM = X_FL[i].inverse() * map.X_FM;
      ASSERT_NEAR(solids[i].signed_distance(X_FL[i].inverse() * result.p_FCo).distance,
                  result.distance, 1e-7);
      for (const Eigen::AlignedBox3d& box : boxes) {
        for (int k = 0; k < 60; ++k) {
          Eigen::Vector3d t = 0.5 * (test::random_vector(&rng, 1.0).array() + 1.0);
          if (k % 2 == 0) t[k % 3] = std::round(t[k % 3]);  // on a side
          const Eigen::Vector3d p = box.min() + t.cwiseProduct(box.sizes());
          const double truth = solids[i].signed_distance(X_LM * p).distance;
          ASSERT_LE(result.lower_bound, truth);
        }
      }
    }
  }
}

// A box that meets no triangle has its centre outside, and some of it inside: it comes in where a
// mesh is open.
TEST(Boxes, ThroughAnOpening) {
  test::Rng rng(36);
  const LinkGeometry open{{test::open_box({0.2, 0.3, 0.2}), Eigen::Isometry3d::Identity(), "open"}};
  LinkGeometry with_a_ball = open;
  with_a_ball.push_back(
      {Sphere{0.02}, Eigen::Isometry3d(Eigen::Translation3d(0, 0, -0.3)), "ball"});
  const std::vector<LinkGeometry> links = {open, with_a_ball};
  const auto model = test::model_of(links, 0.01);
  const std::vector<Eigen::Isometry3d> X_FL(2, Eigen::Isometry3d::Identity());
  ProximityQuery query(model, QueryConfig());
  std::vector<LinkProximity> results;
  int inside = 0, beside = 0;
  for (int i = 0; i < test::scaled(2000); ++i) {
    const double size = std::pow(10.0, test::uniform(&rng, -2.0, -0.9));
    const Eigen::Vector3d center(test::uniform(&rng, -0.3, 0.3), test::uniform(&rng, -0.3, 0.3),
                                 0.1 + size * (i % 2 == 0 ? test::uniform(&rng, 0.0, 0.6) : 1.0));
    const Eigen::Vector3d half = Eigen::Vector3d::Constant(0.5 * size);
    const Eigen::AlignedBox3d box(center - half, center + half);
    const CloudSnapshot map = test::make_map({box});
    query.run(X_FL, {true, true}, {&map}, &results);
    const Solid solid(open);
    double least = kInfinity;
    for (int k = 0; k < 200; ++k) {
      Eigen::Vector3d p = center + test::random_vector(&rng, 1.0).cwiseProduct(half);
      if (k % 2 == 0) p.z() = box.min().z();
      least = std::min(least, solid.signed_distance(p).distance);
    }
    // Next to an opening, within some hundredths of the box's size, the sides are not decided.
    const bool is_inside = least < -0.1 * size && box.min().z() < 0.1 - 0.3 * size;
    const bool is_outside = least > 0.3 * size && box.min().z() > 0.1 + 0.1 * size;
    for (const LinkProximity& result : results) {
      ASSERT_LE(result.lower_bound, least) << center.transpose() << ", " << size;
      if (is_inside) ASSERT_LE(result.distance, 0.0) << center.transpose() << ", " << size;
      if (is_outside) {
        ASSERT_EQ(result.state, LinkState::kNear);
        ASSERT_LE(result.distance - result.lower_bound, QueryConfig().tolerance + 2e-6);
      }
    }
    inside += is_inside ? 1 : 0;
    beside += is_outside ? 1 : 0;
  }
  EXPECT_GT(inside, test::scaled(50));
  EXPECT_GT(beside, test::scaled(300));
}

// The same box, where its surface is out of range: it is not CLEAR, and neither is the robot. Where
// boxes have an extent, that of a box which may be inside counts from its deepest place.
TEST(Boxes, ThroughAnOpeningOutOfRange) {
  const LinkGeometry open{{test::open_box({0.4, 0.4, 0.2}), Eigen::Isometry3d::Identity(), "open"}};
  const auto model = test::model_of({open, test::one(Sphere{0.01})}, 0.01);
  const Solid solid(open);
  const std::vector<Eigen::Isometry3d> X_FL = {Eigen::Isometry3d::Identity(), test::at(5, 0, 0)};
  std::vector<LinkProximity> results;
  RobotProximity robot;
  int inside = 0;
  for (const double half : {0.005, 0.02, 0.05}) {
    for (double low = 0.08; low < 0.1; low += 0.001) {
      const Eigen::AlignedBox3d box(Eigen::Vector3d(-half, -half, low),
                                    Eigen::Vector3d(half, half, low + 2.0 * half));
      CloudSnapshot map = test::make_map({box});
      const double truth = solid.signed_distance({0.0, 0.0, low}).distance;
      inside += truth < 0.0 ? 1 : 0;
      for (const double range : {0.02, 1.0}) {
        for (const double extent : {0.0, 0.2}) {
          SCOPED_TRACE(testing::Message()
                       << half << ", " << low << ", " << range << ", " << extent);
          map.box_extent = extent;
          QueryConfig config;
          config.max_distance = range;
          ProximityQuery query(model, config);
          query.run(X_FL, {true, true}, {&map}, &results);
          ASSERT_LE(results[0].lower_bound, truth - extent);
          query.run_minimum(X_FL, {true, true}, {&map}, &robot);
          ASSERT_LE(robot.nearest.lower_bound, truth - extent);
        }
      }
    }
  }
  EXPECT_GT(inside, 30);
}

TEST(Boxes, TouchAndAlignment) {
  const auto model = test::make_model(
      {Box{{0.2, 0.2, 0.2}}, Shape(test::box({0.2, 0.2, 0.2})), Sphere{0.1}, Cylinder{0.1, 0.2}},
      0.005);
  QueryConfig config;
  config.tolerance = 0.0;
  ProximityQuery query(model, config);
  const std::vector<Eigen::Isometry3d> X_FL(4, Eigen::Isometry3d::Identity());
  std::vector<LinkProximity> results;
  // A cube of 0.2 m whose near side is `gap` above the links' top.
  for (const double gap : {0.5, 0.05, 1e-5, 0.0, -1e-5, -1e-3, -0.05, -0.1, -0.2}) {
    const double low = 0.1 + gap;
    const CloudSnapshot map =
        test::make_map({{Eigen::Vector3d(-0.1, -0.1, low), Eigen::Vector3d(0.1, 0.1, low + 0.2)}});
    query.run(X_FL, std::vector<bool>(4, true), {&map}, &results);
    for (const LinkProximity& result : results) {
      SCOPED_TRACE(gap);
      ASSERT_GE(result.state, LinkState::kNear);
      EXPECT_NEAR(result.direction.norm(), 1.0, 1e-9);
      EXPECT_LT((result.p_FCl - result.p_FCo - result.distance * result.direction).norm(), 1e-9);
      if (gap > 0.0) {
        EXPECT_EQ(result.state, LinkState::kNear);
        EXPECT_NEAR(result.distance, gap, 1e-7);
        EXPECT_LE(result.lower_bound, gap);
        EXPECT_GT(result.lower_bound, gap - 2e-6);
      } else if (gap < -5e-6) {
        EXPECT_EQ(result.state, LinkState::kContact);
        // Deepest where the cube's side is, or in the middle of the link.
        const double truth = std::max(gap, -0.1);
        EXPECT_GE(result.distance, truth - 1e-7);
        EXPECT_LE(result.distance, 0.5 * truth);
        EXPECT_LE(result.lower_bound, truth);
      } else {
        EXPECT_NEAR(result.distance, 0.0, 2e-6);
        EXPECT_LE(result.lower_bound, 0.0);
      }
    }
  }
}

// How deep two boxes overlap: the least over the axes along which they can be parted (Gottschalk
// 1996). Box B is axis-aligned about the origin.
struct Overlap {
  double depth = kInfinity;
  Eigen::Vector3d axis;  // moving A along it by `depth` parts them
};

Overlap overlap_of(const Eigen::Vector3d& half_A, const Eigen::Isometry3d& X_BA,
                   const Eigen::Vector3d& half_B) {
  const Eigen::Matrix3d& R = X_BA.linear();
  std::vector<Eigen::Vector3d> axes;
  for (int i = 0; i < 3; ++i) {
    axes.push_back(R.col(i));
    axes.push_back(Eigen::Vector3d::Unit(i));
    for (int k = 0; k < 3; ++k) axes.push_back(R.col(i).cross(Eigen::Vector3d::Unit(k)));
  }
  Overlap least;
  for (Eigen::Vector3d axis : axes) {
    if (axis.norm() < 1e-3) continue;
    axis.normalize();
    if (axis.dot(X_BA.translation()) < 0.0) axis = -axis;
    const double depth = (R.transpose() * axis).cwiseAbs().dot(half_A) +
                         axis.cwiseAbs().dot(half_B) - axis.dot(X_BA.translation());
    if (depth < least.depth) least = {depth, axis};
  }
  return least;
}

// Where two edges cross, steps along a face's normal from the crossing leave the other box: a box
// link that overlapped a leaf by 44 um was told as NEAR with distance 0. Of these 3000 pairs there
// were 278 such answers, 110 of them with overlaps of more than 10 um and up to 0.5 mm.
TEST(Boxes, SmallOverlapsAreContact) {
  const Eigen::Vector3d half_A(0.05, 0.03, 0.02), half_B(0.04, 0.06, 0.025);
  const auto as_mesh = test::make_model({Shape(test::box(2.0 * half_A))}, 0.005);
  const auto as_box = test::make_model({Box{2.0 * half_A}}, 0.005);
  const CloudSnapshot map = test::make_map({{-half_B, half_B}});
  test::Rng rng(77);
  int near = 0, near_and_deep = 0, contact = 0;
  for (int i = 0; i < test::scaled(3000); ++i) {
    Eigen::Isometry3d X_FL = test::random_pose(&rng, 0.1);
    const double wanted = std::pow(10.0, test::uniform(&rng, -6.5, -3.0));
    // Parts them but for `wanted`; the axis may change on the way.
    for (int k = 0; k < 20; ++k) {
      const Overlap overlap = overlap_of(half_A, X_FL, half_B);
      X_FL.translation() += (overlap.depth - wanted) * overlap.axis;
    }
    const double depth = overlap_of(half_A, X_FL, half_B).depth;
    if (std::abs(depth - wanted) > 1e-3 * wanted) continue;
    ProximityQuery query(i % 2 == 0 ? as_mesh : as_box, {});
    std::vector<LinkProximity> results;
    query.run({X_FL}, {true}, {&map}, &results);
    const LinkProximity& answer = results[0];
    ASSERT_LE(answer.lower_bound, 0.0) << i;
    if (answer.state == LinkState::kContact) {
      EXPECT_LT(answer.distance, 0.0);
      ++contact;
      continue;
    }
    ASSERT_EQ(answer.state, LinkState::kNear);
    EXPECT_EQ(answer.distance, 0.0) << i << ", overlap " << depth;
    ++near;
    if (depth > 5e-6) ++near_and_deep;
  }
  EXPECT_GT(contact, test::scaled(2000));
  EXPECT_EQ(near_and_deep, 0);
  EXPECT_LE(near, test::scaled(6));
}

// A box that holds the whole link, and one wholly inside it, touch no triangle or all of them.
TEST(Boxes, OneInsideTheOther) {
  const TriangleMesh mesh = test::icosphere(0.1, 2);
  const auto model = test::make_model({Shape(mesh)}, 0.005);
  ProximityQuery query(model, {});
  std::vector<LinkProximity> results;
  const std::vector<Eigen::Isometry3d> X_FL(1, Eigen::Isometry3d::Identity());
  const double depth = -test::oracle_signed_distance(mesh, Eigen::Vector3d::Zero());
  for (const double half : {0.001, 0.01, 0.05, 0.5, 10.0}) {
    SCOPED_TRACE(half);
    const Eigen::Vector3d corner = Eigen::Vector3d::Constant(half);
    const CloudSnapshot map = test::make_map({{-corner, corner}});
    query.run(X_FL, {true}, {&map}, &results);
    ASSERT_EQ(results[0].state, LinkState::kContact);
    EXPECT_NEAR(results[0].distance, -depth, 0.005);
    EXPECT_LE(results[0].lower_bound, -depth + 1e-12);
  }
}

TEST(Boxes, PointsAndMapsTogether) {
  const auto model = test::make_model({Sphere{0.1}}, 0.005);
  QueryConfig config;
  config.tolerance = 0.0;
  ProximityQuery query(model, config);
  const std::vector<Eigen::Isometry3d> X_FL(1, Eigen::Isometry3d::Identity());
  std::vector<LinkProximity> results;
  const CloudSnapshot cloud = test::make_snapshot({{0.5, 0, 0}});
  const auto map_from = [](double y) {
    return test::make_map({{Eigen::Vector3d(-1, y, -1), Eigen::Vector3d(1, 2, 1)}});
  };
  const CloudSnapshot near = map_from(0.3), far = map_from(0.8), nothing = test::make_map({});
  query.run(X_FL, {true}, {&cloud, &near}, &results);
  EXPECT_NEAR(results[0].distance, 0.2, 1e-6);
  EXPECT_EQ(results[0].source, 1);
  EXPECT_LT((results[0].direction + Eigen::Vector3d::UnitY()).norm(), 1e-6);
  // Another map replaces the first one: the warm start must not use a box of the old map.
  query.run(X_FL, {true}, {&cloud, &far}, &results);
  EXPECT_NEAR(results[0].distance, 0.4, 1e-6);
  EXPECT_EQ(results[0].source, 0);
  query.run(X_FL, {true}, {&nothing}, &results);
  EXPECT_EQ(results[0].state, LinkState::kClear);
}

// An obstacle that only touches, at distance 0, does not decide whether another one is inside.
TEST(Boxes, PointInsideIsFoundWhereAnotherObstacleTouches) {
  const Shape cube = Box{{0.25, 0.25, 0.25}};  // numbers that float holds exactly
  QueryConfig config;
  config.tolerance = 0.005;
  const Eigen::Isometry3d X_still = Eigen::Isometry3d::Identity();
  const CloudSnapshot touching = test::make_map(
      {{Eigen::Vector3d(0.125, -0.125, -0.125), Eigen::Vector3d(0.375, 0.125, 0.125)}});
  const CloudSnapshot inside = test::make_snapshot({{0.0, 0.122, 0.0}});

  ProximityQuery one_link(test::make_model({cube}, 0.005), config);
  std::vector<LinkProximity> results;
  ASSERT_TRUE(one_link.run({X_still}, {true}, {&touching}, &results));
  ASSERT_EQ(results[0].distance, 0.0);
  ASSERT_TRUE(one_link.run({X_still}, {true}, {&touching, &inside}, &results));
  EXPECT_EQ(results[0].state, LinkState::kContact);
  EXPECT_LE(results[0].lower_bound, -0.003);

  // The box touches one link, the point is inside the other.
  ProximityQuery two_links(test::make_model({cube, cube}, 0.005), config);
  Eigen::Isometry3d X_moved = X_still;
  X_moved.translation().x() = -0.5;
  const CloudSnapshot inside_other = test::make_snapshot({{-0.5, 0.122, 0.0}});
  RobotProximity robot;
  ASSERT_TRUE(
      two_links.run_minimum({X_still, X_moved}, {true, true}, {&touching, &inside_other}, &robot));
  EXPECT_EQ(robot.link, 1);
  EXPECT_EQ(robot.nearest.state, LinkState::kContact);
}

TEST(Boxes, BoundsHoldWheneverTheDeadlinePasses) {
  test::Rng rng(36);
  const std::vector<TriangleMesh> meshes = link_meshes();
  const auto model = test::make_model({meshes.begin(), meshes.end()}, 0.005);
  QueryConfig config;
  config.max_distance = 2.0;
  ProximityQuery query(model, config), full(model, config);
  const std::vector<bool> known(meshes.size(), true);
  std::vector<Eigen::Isometry3d> X_FL(meshes.size());
  std::vector<LinkProximity> results, whole;
  int unfinished = 0;
  for (int i = 0; i < test::scaled(200); ++i) {
    const std::vector<Eigen::AlignedBox3d> boxes = test::random_leaves(&rng, 1500, 1.0, 0.01, 3);
    const CloudSnapshot map = test::make_map(boxes, test::random_pose(&rng, 0.3));
    for (Eigen::Isometry3d& X : X_FL) X = test::random_pose(&rng, 0.5);
    config.deadline = 1e-6 * std::pow(10.0, test::uniform(&rng, 0.0, 3.5));
    query.set_config(config);
    if (!query.run(X_FL, known, {&map}, &results)) ++unfinished;
    ASSERT_TRUE(full.run(X_FL, known, {&map}, &whole));
    for (std::size_t k = 0; k < meshes.size(); ++k) {
      if (results[k].state == LinkState::kUnknown) continue;
      ASSERT_LE(results[k].lower_bound, whole[k].distance);
      ASSERT_GE(results[k].distance, whole[k].lower_bound);
    }
  }
  EXPECT_GT(unfinished, test::scaled(20));
}

}  // namespace
}  // namespace ist
