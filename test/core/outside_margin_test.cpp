// Places near a point outside a mesh with holes: as far as the margin says, none is inside.

#include "internal/geometry/outside_margin.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "geometry/open_edge_hierarchy.h"
#include "internal/geometry/solid_queries.h"
#include "support/instruction_sets.h"
#include "support/meshes.h"
#include "support/oracle.h"
#include "support/sanitizers.h"
#include "support/scene.h"

namespace ist {
namespace {

// A sphere of triangles, of which every n-th is missing.
TriangleMesh perforated(int n) {
  TriangleMesh mesh = test::icosphere(0.1, 3);
  std::vector<TriangleMesh::Triangle> kept;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    if (t % static_cast<std::size_t>(n) != 0) kept.push_back(mesh.triangles[t]);
  }
  mesh.triangles = kept;
  return mesh;
}

// Every triangle twice: the winding number is above 1/2 beyond the open side, too.
TriangleMesh doubled(TriangleMesh mesh) {
  const std::vector<TriangleMesh::Triangle> triangles = mesh.triangles;
  mesh.triangles.insert(mesh.triangles.end(), triangles.begin(), triangles.end());
  return mesh;
}

// One in three is near the open side of the box, which no surface closes.
Eigen::Vector3d random_place(test::Rng* rng, int i) {
  Eigen::Vector3d p = test::random_vector(rng, i % 2 == 0 ? 0.15 : 0.11);
  if (i % 3 == 0) p.z() = 0.1 - 0.01 * std::abs(p.z());
  return p;
}

// The same inside, where the box about the mesh ends the inside, too.
TEST(OutsideMargin, SideMarginHoldsNoPlaceOfTheOtherSide) {
  test::Rng rng(182);
  int positive[2] = {}, near_box = 0;
  for (const TriangleMesh& mesh :
       {test::open_box({0.15, 0.1, 0.2}), doubled(test::open_box({0.15, 0.1, 0.2})), perforated(3),
        perforated(1000)}) {
    const Solid solid({GeometryElement{mesh, Eigen::Isometry3d::Identity(), "test"}});
    const double top = test::bounds(mesh).max().z();
    for (int i = 0; i < test::scaled(3000); ++i) {
      const Eigen::Vector3d p = random_place(&rng, i);
      const double distance = std::abs(solid.signed_distance(p).distance);
      const SideMargin found = side_margin(solid, p, distance);
      const SideMargin outside = outside_margin(solid, p, distance);
      ASSERT_EQ(found.is_inside, solid.is_inside(p));
      ASSERT_EQ(found.is_inside, outside.is_inside);
      ASSERT_LE(found.margin, distance);
      ASSERT_EQ(outside.margin, found.is_inside ? 0.0 : found.margin);
      if (!(found.margin > 0.0)) continue;
      ++positive[found.is_inside ? 1 : 0];
      near_box += found.is_inside && top - p.z() < 1.001 * found.margin ? 1 : 0;
      for (int k = 0; k < 10; ++k) {
        const Eigen::Vector3d offset = found.margin *
                                       (k % 2 == 0 ? 1.0 : std::sqrt(test::uniform(&rng, 0, 1))) *
                                       test::random_vector(&rng, 1.0).normalized();
        ASSERT_EQ(solid.is_inside(p + offset), found.is_inside)
            << p.transpose() << ", " << offset.norm();
      }
    }
  }
  EXPECT_GT(positive[0], test::scaled(2000));
  EXPECT_GT(positive[1], test::scaled(1000));
  EXPECT_GT(near_box, test::scaled(20));
}

// A square about the z axis; its border is in `pieces` edges for each side.
TriangleMesh fan(int pieces, double half) {
  TriangleMesh mesh;
  mesh.vertices.push_back(Eigen::Vector3d::Zero());
  for (int side = 0; side < 4; ++side) {
    for (int i = 0; i < pieces; ++i) {
      const Eigen::Vector3d p(half, half * (2.0 * i / pieces - 1.0), 0.0);
      mesh.vertices.push_back(Eigen::AngleAxisd(0.5 * EIGEN_PI * side, Eigen::Vector3d::UnitZ()) *
                              p);
    }
  }
  const auto corners = static_cast<std::uint32_t>(4 * pieces);
  for (std::uint32_t i = 0; i < corners; ++i) {
    mesh.triangles.push_back({0, 1 + i, 1 + (i + 1) % corners});
  }
  return mesh;
}

// The change of the winding number from p to q, if the straight line between them does not cross
// the mesh: crossing it changes it by one, which is more than these places are apart.
double change_of_winding(const TriangleMesh& mesh, const Eigen::Vector3d& p,
                         const Eigen::Vector3d& q) {
  const double change = test::oracle_winding(mesh, q) - test::oracle_winding(mesh, p);
  return std::abs(change - std::round(change));
}

// The largest change from p to a place at `radius` from it, by hill climbing.
double largest_change(const TriangleMesh& mesh, const Eigen::Vector3d& p, double radius,
                      test::Rng* rng) {
  Eigen::Vector3d best = Eigen::Vector3d::UnitX();
  double change = 0.0;
  for (int k = 0; k < 40; ++k) {
    const double step = k < 10 ? 10.0 : std::pow(0.85, k - 10);
    const Eigen::Vector3d tried = (best + step * test::random_vector(rng, 1.0)).normalized();
    const double found = change_of_winding(mesh, p, p + radius * tried);
    if (!(found > change)) continue;
    change = found;
    best = tried;
  }
  return change;
}

struct Steadiness {
  double most_used = 0.0;  // share of the change that was allowed
  int positive = 0, large = 0;
};

// Asks at places about the open edges of a mesh, from near to far.
Steadiness check_steady(const TriangleMesh& mesh, double size, test::Rng* rng) {
  const OpenEdgeHierarchy edges(mesh);
  Steadiness found;
  for (int i = 0; i < test::scaled(300); ++i) {
    const double from = std::pow(10.0, test::uniform(rng, -4.0, 1.0)) * size;
    const Eigen::Vector3d p =
        size * test::random_vector(rng, 1.0) * (i % 2) +
        (mesh.vertices.back() + from * test::random_vector(rng, 1.0)) * (1 - i % 2);
    const double allowed = std::pow(10.0, test::uniform(rng, -2.0, -0.4));
    const double radius = edges.steady_radius(p, allowed, size);
    EXPECT_LE(radius, size);
    if (!(radius > 0.0)) continue;
    ++found.positive;
    found.large += radius > 0.1 * size ? 1 : 0;
    const double used = largest_change(mesh, p, radius, rng) / allowed;
    EXPECT_LE(used, 1.0 + 1e-6) << p.transpose() << ", " << radius;
    if (radius < size) found.most_used = std::max(found.most_used, used);
  }
  return found;
}

TEST(OutsideMargin, WindingNumberIsSteady) {
  test::Rng rng(182);
  for (const double size : {1e-3, 1.0, 1e3}) {
    double most_used = 0.0;
    for (const TriangleMesh& mesh :
         {fan(1, size), fan(100, size), test::sheet(size), test::open_box({size, size, size})}) {
      const Steadiness found = check_steady(mesh, size, &rng);
      EXPECT_GT(found.positive, test::scaled(100));
      EXPECT_GT(found.large, test::scaled(20) / 2);
      most_used = std::max(most_used, found.most_used);
    }
    // Few cases do not come near the limit.
    if (!test::kSanitized) EXPECT_GT(most_used, 0.5) << "the radius could be twice as large";
  }
}

// Edges in a ball of radius 1; some of them count more than once.
// @param along  [m] what all have in common: a large one, and most edges on one side, make clusters
//               whose first moments matter
std::vector<OpenEdgeHierarchy::Edge> random_edges(std::size_t count, double along, test::Rng* rng) {
  std::vector<OpenEdgeHierarchy::Edge> edges;
  while (edges.size() < count) {
    Eigen::Vector3d from = test::random_vector(rng, 0.5);
    if (along > 0.1) from.y() = std::pow(test::uniform(rng, 0.0, 1.0), 4.0) - 0.5;
    const Eigen::Vector3d to =
        from + test::random_vector(rng, 0.1) + along * Eigen::Vector3d::UnitX();
    edges.push_back({from, to, edges.size() % 5 == 0 ? 2.0 : 1.0});
  }
  return edges;
}

// What float and clusters lose is within what is said, among many edges of a mesh and far from
// them, with every instruction set.
void check_many_edges() {
  test::Rng rng(185);
  for (int i = 0; i < test::scaled(40); ++i) {
    const std::vector<OpenEdgeHierarchy::Edge> edges =
        random_edges(2000, i % 4 < 2 ? 0.025 : 0.4, &rng);
    const double far = i % 2 == 0 ? 0.0 : std::pow(10.0, test::uniform(&rng, 0.0, 1.5));
    const Eigen::Vector3d p =
        test::random_vector(&rng, 0.6) + far * test::random_vector(&rng, 1.0).normalized();
    const OpenEdgeSums sums = OpenEdgeHierarchy(edges).sums(p);
    Eigen::Vector3d error(-sums.field[0], -sums.field[1], -sums.field[2]);
    double curvature = 0.0;
    for (const OpenEdgeHierarchy::Edge& edge : edges) {  // the integral of a straight edge
      const Eigen::Vector3d a = edge.from - p, b = edge.to - p;
      const double la = a.norm(), lb = b.norm();
      error += edge.count * (la + lb) / (la * lb * (la * lb + a.dot(b))) * a.cross(b);
      const double middle = (0.5 * (a + b)).norm() + 0.5 * (b - a).norm();
      curvature += edge.count * 2.0 * (b - a).norm() / (middle * middle * middle);
    }
    ASSERT_LE(error.norm(), sums.field_error);
    ASSERT_GT(sums.curvature, curvature);
  }
}

TEST(OutsideMargin, FieldOfManyEdges) { test::for_each_instruction_set(check_many_edges); }

// The edges of a large mesh take a second to collect, which nothing could end.
TEST(OutsideMargin, EdgesCanBeCancelled) {
  const TriangleMesh mesh = perforated(3);
  int calls = 0;
  const OpenEdgeHierarchy whole(mesh, [&] { return ++calls < 0; });
  ASSERT_GT(calls, 1);
  for (const int last : {1, calls}) {
    int asked = 0;
    EXPECT_THROW(OpenEdgeHierarchy(mesh, [&] { return ++asked >= last; }), Cancelled);
    EXPECT_EQ(asked, last);
  }
  const Eigen::Vector3d p(0.15, 0.0, 0.0);
  const double radius = whole.steady_radius(p, 0.1, 1.0);
  EXPECT_GT(radius, 0.0);
  EXPECT_EQ(radius, OpenEdgeHierarchy(mesh).steady_radius(p, 0.1, 1.0));
}

}  // namespace
}  // namespace ist
