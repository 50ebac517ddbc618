// The sides of a link's surface: that of a place, and balls on one side, which tell those of other
// places.

#include "proximity/coherence/side_balls.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "internal/geometry/outside_margin.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "support/meshes.h"
#include "support/oracle.h"
#include "support/random_links.h"
#include "support/sanitizers.h"
#include "support/scene.h"

namespace ist {
namespace {

using Side = NearSurface::Side;

TEST(SideBalls, TellTheSideOfThePlacesInThem) {
  SideBalls balls(false);
  const Eigen::Vector3d p(0.1, 0.2, 0.3), q(-0.1, 0.2, 0.3);
  EXPECT_EQ(balls.find(p).side, Side::kUnknown);
  balls.store(p, {Side::kOutside, 0.001});
  balls.store(q, {Side::kInside, 0.0005});
  EXPECT_EQ(balls.find(p).side, Side::kOutside);
  EXPECT_NEAR(balls.find(p).margin, 0.001, 1e-7);
  EXPECT_LE(balls.find(p).margin, 0.001);
  EXPECT_EQ(balls.find(q).side, Side::kInside);
  const Eigen::Vector3d step(0.0003, 0.0002, -0.0002);
  EXPECT_NEAR(balls.find(p + step).margin, 0.001 - step.norm(), 1e-7);
  EXPECT_LE(balls.find(p + step).margin, 0.001 - step.norm());
  for (const Eigen::Vector3d& other :
       {Eigen::Vector3d(p + 4 * step), Eigen::Vector3d(q + 2 * step), Eigen::Vector3d(0, 0, 0)}) {
    EXPECT_EQ(balls.find(other).side, Side::kUnknown) << other.transpose();
    EXPECT_EQ(balls.find(other).margin, 0.0);
  }
}

TEST(SideBalls, TellNothingOfPlacesThatAreNotFinite) {
  SideBalls balls(false);
  balls.store(Eigen::Vector3d::Zero(), {Side::kOutside, 1.0});
  for (const double value :
       {std::numeric_limits<double>::quiet_NaN(), HUGE_VAL, -HUGE_VAL, 1e300}) {
    const Eigen::Vector3d p(0.0, value, 0.0);
    balls.store(p, {Side::kOutside, 1.0});
    EXPECT_EQ(balls.find(p).side, Side::kUnknown) << value;
  }
  const Eigen::Vector3d q(0.5, 0.5, 0.5);
  balls.store(q, {Side::kOutside, std::numeric_limits<double>::quiet_NaN()});
  balls.store(q, {Side::kUnknown, 1.0});
  balls.store(q, {Side::kInside, 0.0});
  balls.store(q, {Side::kInside, -1.0});
  EXPECT_EQ(balls.find(q).side, Side::kUnknown);
}

// Many more places than the table has room for, of a mesh with holes.
TEST(SideBalls, AgreeWithTheWindingNumber) {
  test::Rng rng(231);
  const Solid solid(test::one(test::open_box({0.15, 0.1, 0.2})));
  SideBalls balls(true);
  std::vector<Eigen::Vector3d> places;
  for (int i = 0; i < 400; ++i) places.push_back(test::random_vector(&rng, 0.11));
  int outside = 0, inside = 0;
  for (std::size_t i = 0; i < static_cast<std::size_t>(test::scaled(40000)); ++i) {
    const Eigen::Vector3d p = test::random_vector(&rng, 0.004) + places[i % places.size()];
    const SideBalls::Found found = balls.find(p);
    if (found.side != Side::kUnknown) {
      const Eigen::Vector3d q =
          p + 0.999 * found.margin * test::random_vector(&rng, 1.0).normalized();
      ASSERT_EQ(found.side == Side::kInside, solid.is_inside(p)) << p.transpose();
      ASSERT_EQ(found.side == Side::kInside, solid.is_inside(q)) << q.transpose();
      ++(found.side == Side::kInside ? inside : outside);
      continue;
    }
    const SideMargin measured = side_margin(solid, p, std::abs(solid.signed_distance(p).distance));
    balls.store(p, {measured.is_inside ? Side::kInside : Side::kOutside, measured.margin});
  }
  EXPECT_GT(outside, test::scaled(1000));
  EXPECT_GT(inside, test::scaled(1000));
}

// A point of the surface: of a face, an edge, or a corner.
Eigen::Vector3d surface_point(const TriangleMesh& mesh, test::Rng* rng) {
  const std::size_t t = (*rng)() % mesh.triangles.size(), kind = (*rng)() % 4;
  const double a = kind == 0 ? 1.0 : test::uniform(rng, 0, 1);
  const double b = kind == 0 ? 0.0 : kind == 1 ? 1.0 - a : test::uniform(rng, 0, 1.0 - a);
  return a * mesh.corner(t, 0) + b * mesh.corner(t, 1) + (1.0 - a - b) * mesh.corner(t, 2);
}

// Of three kinds, of a size [m], about the origin or as far as 10 m from it.
TriangleMesh random_mesh(test::Rng* rng, int number, double size) {
  TriangleMesh mesh = number % 3 == 0   ? test::box({1.0, 0.6, 0.8})
                      : number % 3 == 1 ? test::random_lump(rng)
                                        : test::torus(0.4, 0.1, 16, 8);
  const double scale = size / test::bounds(mesh).sizes().maxCoeff();
  for (Eigen::Vector3d& v : mesh.vertices) v *= scale;
  return test::moved(mesh, test::random_pose(rng, number % 2 == 0 ? 0.0 : 10.0));
}

// Float moves the corners of a mesh of 10 m by half a micrometre: up to 1 um from the surface its
// winding number told the wrong side.
TEST(Sides, AreThoseOfDoublePrecisionHoweverLargeTheMesh) {
  test::Rng rng(173);
  int inside = 0, outside = 0;
  for (const double size : {1.0, 3.0, 10.0}) {
    for (int m = 0; m < 12; ++m) {
      const TriangleMesh mesh = random_mesh(&rng, m, size);
      const auto model = test::model_of({test::one(mesh)}, 0.2 * size);
      const Solid& solid = model->links[0].solid;
      ProximityQuery query(model, QueryConfig());
      for (const double height : {1e-12, 1e-10, 1e-9, 1e-8, 5e-8, 2e-7, 1e-6}) {
        for (int i = 0; i < test::scaled(40); ++i) {
          const Eigen::Vector3d p =
              surface_point(mesh, &rng) + height * test::random_vector(&rng, 1.0).normalized();
          const double truth = test::oracle_signed_distance(mesh, p);
          if (std::abs(truth) < 0.3 * height) continue;
          ASSERT_EQ(solid.is_inside(p), truth < 0.0)
              << height << " m from a mesh of " << size << " m, " << m;
          (truth < 0.0 ? inside : outside) += 1;
          // The same through a query: the stored point is asked about.
          const CloudSnapshot cloud = test::make_snapshot({p}, p);
          LinkProximity result;
          ASSERT_TRUE(query.run_link(0, Eigen::Isometry3d::Identity(), {&cloud}, &result));
          ASSERT_EQ(result.state == LinkState::kContact, truth < 0.0);
        }
      }
    }
  }
  EXPECT_GT(inside, test::scaled(2500));
  EXPECT_GT(outside, test::scaled(2500));
}

}  // namespace
}  // namespace ist
