// Distance fields: what their nodes and balls promise, against the exact geometry and brute force.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <limits>
#include <memory>
#include <variant>
#include <vector>

#include "internal/geometry/cancelled.h"
#include "internal/geometry/distance_field.h"
#include "support/distance_fields.h"
#include "support/hard_shapes.h"
#include "support/meshes.h"
#include "support/random_links.h"
#include "support/shape_oracle.h"
#include "support/trial.h"

namespace ist {
namespace {

constexpr DistanceField::Detail kDetails[] = {DistanceField::Detail::kCoarse,
                                              DistanceField::Detail::kFine};

Eigen::Vector3d node(const DistanceField::Level& level, std::size_t i) {
  const auto nx = static_cast<std::size_t>(level.size[0]),
             ny = static_cast<std::size_t>(level.size[1]);
  const std::size_t index[3] = {i % nx, i / nx % ny, i / (nx * ny)};
  Eigen::Vector3d p;
  for (int axis = 0; axis < 3; ++axis) {
    p[axis] = static_cast<double>(level.low[axis]) +
              static_cast<double>(index[axis]) * static_cast<double>(level.cell);
  }
  return p;
}

std::size_t nodes_of(const DistanceField::Level& level) {
  return static_cast<std::size_t>(level.size[0]) * static_cast<std::size_t>(level.size[1]) *
         static_cast<std::size_t>(level.size[2]);
}

// [m] To the nearest part of a link: its surfaces, and all of a primitive.
double distance_of(const LinkGeometry& link, const Eigen::Vector3d& p) {
  double least = std::numeric_limits<double>::infinity();
  for (const GeometryElement& element : link) {
    const auto* mesh = std::get_if<TriangleMesh>(&element.shape);
    const Eigen::Vector3d p_E = element.X_LE.inverse() * p;
    least =
        std::min(least, mesh != nullptr ? test::oracle_distance(*mesh, p_E)
                                        : test::oracle_signed_distance(LinkGeometry{element}, p));
  }
  return std::max(least, 0.0);
}

struct FieldOfLink {
  Solid solid;
  LinkGeometry link;
  DistanceField field;
};

// Coarse and fine in turn.
const std::vector<FieldOfLink>& fields_of_random_links() {
  static const std::vector<FieldOfLink> kFields = [] {
    test::Rng rng(3);
    std::vector<FieldOfLink> fields;
    for (const LinkGeometry& link : test::random_links(&rng)) {
      const Solid solid(link);
      for (const auto detail : kDetails)
        fields.push_back({solid, link, DistanceField(solid, detail)});
    }
    return fields;
  }();
  return kFields;
}

TEST(DistanceField, NodesAreLowerBoundsAndHardlyTooLow) {
  test::Rng rng(3);
  for (const auto& [solid, link, field] : fields_of_random_links()) {
    ASSERT_FALSE(field.empty());
    for (const DistanceField::Level& level : field.levels()) {
      const double slack = static_cast<double>(DistanceField::kStep) +
                           static_cast<double>(level.cell / DistanceField::kSlackParts);
      for (std::size_t k = 0; k < 60; ++k) {
        const auto i = static_cast<std::size_t>(
            test::uniform(&rng, 0.0, static_cast<double>(nodes_of(level)) - 0.5));
        const std::uint16_t stored = field.values()[level.first + i];
        const double value = stored * static_cast<double>(DistanceField::kStep);
        const double truth = distance_of(link, node(level, i));
        ASSERT_LE(value, truth + 1e-9);
        if (stored != DistanceField::kFar) ASSERT_GE(value, truth - slack - 1e-9);
      }
    }
  }
}

// Within a node's ball, nothing is inside, also where a mesh has holes.
TEST(DistanceField, BallsHoldNothingThatIsInside) {
  test::Rng rng(4);
  int balls = 0, near_solids = 0;
  for (const auto& [solid, link, field] : fields_of_random_links()) {
    const DistanceField::Level& finest = field.levels().front();
    for (std::size_t k = 0; k < 2000; ++k) {
      const auto i = static_cast<std::size_t>(
          test::uniform(&rng, 0.0, static_cast<double>(nodes_of(finest)) - 0.5));
      const double radius = field.outside()[i] * static_cast<double>(DistanceField::kOutsideStep);
      if (radius == 0.0) continue;
      ++balls;
      const Eigen::Vector3d place =
          node(finest, i) +
          test::uniform(&rng, 0.0, radius) * test::random_vector(&rng, 1.0).normalized();
      near_solids += solid.signed_distance(place).distance < 0.01 ? 1 : 0;
      ASSERT_FALSE(solid.is_inside(place));
      ASSERT_LE(radius, distance_of(link, node(finest, i)) + 1e-9);
    }
  }
  EXPECT_GT(balls, 5000);
  EXPECT_GT(near_solids, 200);
}

// Links as large as an arm's, and larger: the rounding of float is more than that of small ones.
TEST(DistanceField, NoNodeInsideIsTakenForOutside) {
  test::Rng rng(5);
  int inside = 0;
  for (const double size : {0.4, 1.2, 2.0}) {
    for (const TriangleMesh& mesh :
         {test::box({size, 0.6 * size, 0.3 * size}), test::icosphere(0.5 * size, 3),
          test::torus(0.4 * size, 0.15 * size, 24, 12)}) {
      for (const Eigen::Isometry3d& X_LE :
           {Eigen::Isometry3d::Identity(), test::random_pose(&rng, 0.1)}) {
        const Solid solid({GeometryElement{mesh, X_LE, "test"}});
        for (const auto detail : kDetails) {
          const DistanceField field(solid, detail);
          const DistanceField::Level& finest = field.levels().front();
          for (std::size_t i = 0; i < nodes_of(finest); i += 7) {
            if (!solid.is_inside(node(finest, i))) continue;
            ++inside;
            ASSERT_EQ(field.outside()[i], 0) << size;
          }
        }
      }
    }
  }
  EXPECT_GT(inside, 20000);
}

// About a large link cells are larger, so that memory is bounded.
TEST(DistanceField, MemoryIsBounded) {
  for (const double size : {1e-4, 0.3, 3.0, 300.0, 9000.0}) {
    const Solid solid(test::one(Box{{size, 0.5 * size, 0.1 * size}}));
    const DistanceField field(solid), coarse(solid, DistanceField::Detail::kCoarse);
    EXPECT_FALSE(field.empty()) << size;
    EXPECT_LT(field.memory(), 3000000U) << size;
    EXPECT_FALSE(coarse.empty()) << size;
    EXPECT_LT(coarse.memory(), field.memory()) << size;
  }
}

TEST(DistanceField, CanBeCancelled) {
  const Solid solid(test::one(Sphere{0.1}));
  for (const auto detail : kDetails) {
    EXPECT_THROW(DistanceField(solid, detail, [] { return true; }), Cancelled);
  }
}

// Contact found by a distance field where links are large, of several elements, or nowhere.

// A box of points may be kilometres deep.
TEST(FieldContact, ALargeLinkHasDeepPoints) {
  constexpr double kSize = 5000.0;
  test::Rng rng(1);
  for (const TriangleMesh& mesh :
       {test::box({kSize, kSize, kSize}), test::open_box({kSize, kSize, kSize})}) {
    const LinkGeometry link = test::one(mesh);
    const auto model = test::with_fields(test::model_of({link}, 100.0));
    for (int round = 0; round < 10; ++round) {
      std::vector<Eigen::Vector3d> points;
      for (int k = 0; k < 300; ++k) points.push_back(test::random_vector(&rng, 0.499 * kSize));
      const CloudSnapshot cloud = test::make_snapshot(points);
      const Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();
      ProximityQuery query(model, {});
      LinkProximity result;
      ASSERT_TRUE(query.run_link(0, X_FL, {&cloud}, &result));
      EXPECT_LT(result.distance, -1000.0);
      test::expect_truth(result, test::truth_of(link, X_FL, points, cloud), query.config(), X_FL,
                         1e-6 * kSize, kSize);
      if (HasFailure()) return;
    }
  }
}

// Another link in contact is no reason for a wide interval.
TEST(FieldContact, TheMinimumOfSeveralElementsIsAsExactAsAsked) {
  const Eigen::Isometry3d X_LE(Eigen::Translation3d(0.1, 0.0, 0.0));
  const LinkGeometry two = {
      GeometryElement{test::open_box({0.1, 0.1, 0.1}), Eigen::Isometry3d::Identity(), "open box"},
      GeometryElement{test::box({0.1, 0.05, 0.05}), X_LE, "box"}};
  const auto model =
      test::with_fields(test::model_of({test::one(Box{{0.1, 0.1, 0.1}}), two}, 0.02));
  QueryConfig config;
  config.tolerance = 0.0;
  test::Rng rng(1);
  int contacts = 0;
  for (int round = 0; round < 200; ++round) {
    std::vector<Eigen::Vector3d> points;
    for (int k = 0; k < 30; ++k) points.push_back(test::random_vector(&rng, 0.15));
    const CloudSnapshot cloud = test::make_snapshot(points);
    std::vector<Eigen::Isometry3d> X_FL(2, Eigen::Isometry3d::Identity());
    X_FL[1].translation() = test::random_vector(&rng, 0.15);
    ProximityQuery query(model, config);
    RobotProximity result;
    ASSERT_TRUE(query.run_minimum(X_FL, {true, true}, {&cloud}, &result));
    if (result.nearest.state != LinkState::kContact) continue;
    ++contacts;
    ASSERT_LT(result.nearest.distance - result.nearest.lower_bound, 1e-6) << round;
  }
  EXPECT_GT(contacts, 100);
}

// The depth in a link is that in one of its elements: the surface of another is no way out.
TEST(FieldContact, ASmallElementInALargeOneMakesNothingLessDeep) {
  const LinkGeometry link = {
      GeometryElement{test::box({0.4, 0.4, 0.4}), Eigen::Isometry3d::Identity(), "large"},
      GeometryElement{test::box({0.1, 0.1, 0.1}), Eigen::Isometry3d::Identity(), "small"}};
  const auto model = test::with_fields(test::model_of({link}, 0.02));
  const Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();
  test::Rng rng(2);
  for (int round = 0; round < 100; ++round) {
    std::vector<Eigen::Vector3d> points = {Eigen::Vector3d(0.12, 0.0, 0.0)};
    for (int k = 0; k < 20; ++k) points.push_back(test::random_vector(&rng, 0.06));
    const CloudSnapshot cloud = test::make_snapshot(points);
    ProximityQuery query(model, {});
    LinkProximity result;
    ASSERT_TRUE(query.run_link(0, X_FL, {&cloud}, &result));
    test::expect_truth(result, test::truth_of(link, X_FL, points, cloud), query.config(), X_FL);
    if (HasFailure()) return;
  }
}

// What is asked for a pose that is not finite is not known, with a field and without.
TEST(FieldContact, APoseThatIsNotFiniteIsUnknown) {
  const std::vector<LinkGeometry> links = {test::one(test::box({0.1, 0.1, 0.1})),
                                           test::one(test::open_box({0.1, 0.1, 0.1}))};
  test::Rng rng(1);
  std::vector<Eigen::Vector3d> points;
  for (int k = 0; k < 300; ++k) points.push_back(test::random_vector(&rng, 0.2));
  const CloudSnapshot cloud = test::make_snapshot(points);
  for (const auto& model :
       {test::model_of(links, 0.01), test::with_fields(test::model_of(links, 0.01))}) {
    ProximityQuery query(model, {});
    std::vector<LinkProximity> results;
    RobotProximity minimum;
    for (const double bad :
         {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
      for (int at = 0; at < 12; ++at) {
        std::vector<Eigen::Isometry3d> X_FL(2, Eigen::Isometry3d::Identity());
        X_FL[0].matrix()(at / 4, at % 4) = bad;
        query.run(X_FL, {true, true}, {&cloud}, &results);
        EXPECT_EQ(results[0].state, LinkState::kUnknown) << bad << " at " << at;
        EXPECT_EQ(results[1].state, LinkState::kContact) << bad << " at " << at;
        query.run_minimum(X_FL, {true, true}, {&cloud}, &minimum);
        EXPECT_FALSE(minimum.all_known);
        query.run_link(0, X_FL[0], {&cloud}, &results[0]);
        EXPECT_EQ(results[0].state, LinkState::kUnknown) << bad << " at " << at;
      }
    }
  }
}

}  // namespace
}  // namespace ist
