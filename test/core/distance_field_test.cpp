// Distance fields: what their nodes and balls promise, against the exact geometry and brute force.

#include "internal/geometry/distance_field.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <variant>
#include <vector>

#include "internal/geometry/cancelled.h"
#include "support/hard_shapes.h"
#include "support/meshes.h"
#include "support/random_links.h"
#include "support/shape_oracle.h"

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
    const Eigen::Vector3d p_E = element.X_LE.inverse() * p;
    const auto* mesh = std::get_if<TriangleMesh>(&element.shape);
    const double distance =
        mesh != nullptr
            ? test::oracle_distance(*mesh, p_E)
            : std::visit(
                  [&](const auto& shape) { return test::oracle_signed_distance(shape, p_E); },
                  element.shape);
    least = std::min(least, distance);
  }
  return std::max(least, 0.0);
}

struct FieldOfLink {
  Solid solid;
  LinkGeometry link;
  DistanceField field;
};

// Coarse and fine in turn.
std::vector<FieldOfLink> fields_of_random_links(test::Rng* rng) {
  std::vector<FieldOfLink> fields;
  for (const LinkGeometry& link : test::random_links(rng)) {
    const Solid solid(link);
    for (const auto detail : kDetails)
      fields.push_back({solid, link, DistanceField(solid, detail)});
  }
  return fields;
}

TEST(DistanceField, NodesAreLowerBoundsAndHardlyTooLow) {
  test::Rng rng(3);
  for (const auto& [solid, link, field] : fields_of_random_links(&rng)) {
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
  for (const auto& [solid, link, field] : fields_of_random_links(&rng)) {
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
  for (const double size : {0.4, 0.8, 1.2, 2.0}) {
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

// The surface points of the grid of depths are of the surface, and hardly farther than it is; its
// balls hold nothing that is inside.
TEST(DistanceField, DepthsAreFromTheSurface) {
  test::Rng rng(6);
  int fields = 0, balls = 0, inside = 0;
  for (const auto& [solid, link, field] : fields_of_random_links(&rng)) {
    ASSERT_EQ(field.has_depths(), link.size() == 1);
    if (!field.has_depths()) continue;
    ++fields;
    const DistanceField::Level& grid = field.depths();
    ASSERT_EQ(field.surface_xy().size(), nodes_of(grid));
    const auto unsigned_distance = [&](const Eigen::Vector3d& p) {
      const auto* mesh = std::get_if<TriangleMesh>(&link[0].shape);
      return mesh != nullptr ? test::oracle_distance(*mesh, p)
                             : std::abs(test::oracle_signed_distance(link, p));
    };
    const double slack = 2e-6 + static_cast<double>(field.surface_step());
    for (int k = 0; k < 200; ++k) {
      const auto i = static_cast<std::size_t>(
          test::uniform(&rng, 0.0, static_cast<double>(nodes_of(grid)) - 0.5));
      const std::uint32_t xy = field.surface_xy()[i], z_ball = field.surface_z_ball()[i];
      const auto part = [&](std::uint32_t half) {
        return static_cast<std::int16_t>(half & 0xFFFFU) *
               static_cast<double>(field.surface_step());
      };
      const Eigen::Vector3d to_surface(part(xy), part(xy >> 16U), part(z_ball));
      const Eigen::Vector3d p = node(grid, i);
      ASSERT_LE(unsigned_distance(p + to_surface), slack);
      const double truth = unsigned_distance(p);
      ASSERT_LE(to_surface.norm(),
                truth + static_cast<double>(grid.cell / DistanceField::kSlackParts) + slack);
      inside += solid.is_inside(p) ? 1 : 0;
      const double radius = (z_ball >> 16U) * static_cast<double>(DistanceField::kBallStep);
      ASSERT_LE(radius, truth + 1e-9);
      if (radius == 0.0) continue;
      ++balls;
      ASSERT_FALSE(solid.is_inside(p + test::uniform(&rng, 0.0, radius) *
                                           test::random_vector(&rng, 1.0).normalized()));
    }
  }
  EXPECT_GT(fields, 10);
  EXPECT_GT(balls, 500);
  EXPECT_GT(inside, 500);
}

TEST(DistanceField, GridsLieWithinEachOtherAndReachFar) {
  const Solid solid({GeometryElement{Box{{0.3, 0.1, 0.2}}, Eigen::Isometry3d::Identity(), "box"}});
  const auto box_of = [](const DistanceField::Level& level) {
    return Eigen::AlignedBox3d(node(level, 0), node(level, nodes_of(level) - 1));
  };
  for (const auto detail : kDetails) {
    const DistanceField field(solid, detail);
    ASSERT_GE(field.levels().size(), 3U);
    for (std::size_t l = 1; l < field.levels().size(); ++l) {
      EXPECT_TRUE(box_of(field.levels()[l]).contains(box_of(field.levels()[l - 1])));
      EXPECT_GT(field.levels()[l].cell, field.levels()[l - 1].cell);
    }
    EXPECT_TRUE(box_of(field.levels().front()).contains(field.bounds().cast<double>()));
    EXPECT_TRUE(box_of(field.levels().back()).contains(Eigen::Vector3d(1.2, 1.2, 1.2)));
  }
}

// About a large link cells are larger, so that memory is bounded.
TEST(DistanceField, MemoryIsBounded) {
  for (const double size : {1e-4, 0.3, 3.0, 300.0, 9000.0}) {
    const Solid solid({GeometryElement{Box{{size, 0.5 * size, 0.1 * size}},
                                       Eigen::Isometry3d::Identity(), "box"}});
    const DistanceField field(solid), coarse(solid, DistanceField::Detail::kCoarse);
    EXPECT_FALSE(field.empty()) << size;
    EXPECT_LT(field.memory(), 3000000U) << size;
    EXPECT_FALSE(coarse.empty()) << size;
    EXPECT_LT(coarse.memory(), field.memory()) << size;
  }
}

TEST(DistanceField, NothingHasAnEmptyField) { EXPECT_TRUE(DistanceField(Solid()).empty()); }

TEST(DistanceField, CanBeCancelled) {
  const Solid solid({GeometryElement{Sphere{0.1}, Eigen::Isometry3d::Identity(), "sphere"}});
  for (const auto detail : kDetails) {
    EXPECT_THROW(DistanceField(solid, detail, [] { return true; }), Cancelled);
  }
}

}  // namespace
}  // namespace ist
