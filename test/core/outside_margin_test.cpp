// Places near a point outside a mesh with holes: as far as the margin says, none is inside.

#include "internal/geometry/outside_margin.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
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

TEST(OutsideMargin, HoldsNoPlaceInside) {
  test::Rng rng(181);
  int positive = 0, large = 0;
  for (const TriangleMesh& mesh :
       {test::open_box({0.15, 0.1, 0.2}), perforated(3), perforated(10), perforated(1000)}) {
    const Solid solid({GeometryElement{mesh, Eigen::Isometry3d::Identity(), "test"}});
    ASSERT_FALSE(solid.is_closed());
    for (int i = 0; i < test::scaled(3000); ++i) {
      const Eigen::Vector3d p = test::random_vector(&rng, i % 2 == 0 ? 0.15 : 0.11);
      const double distance = std::abs(solid.signed_distance(p).distance);
      const SideMargin found = outside_margin(solid, p, distance);
      ASSERT_EQ(found.is_inside, solid.is_inside(p));
      ASSERT_LE(found.margin, distance);
      if (!(found.margin > 0.0)) continue;
      ASSERT_FALSE(found.is_inside);
      ++positive;
      large += found.margin > 1e-3 ? 1 : 0;
      for (int k = 0; k < 10; ++k) {
        const Eigen::Vector3d offset = found.margin *
                                       (k % 2 == 0 ? 1.0 : std::sqrt(test::uniform(&rng, 0, 1))) *
                                       test::random_vector(&rng, 1.0).normalized();
        ASSERT_FALSE(solid.is_inside(p + offset)) << p.transpose() << ", " << offset.norm();
      }
    }
  }
  EXPECT_GT(positive, test::scaled(2000));
  EXPECT_GT(large, test::scaled(1000));
}

// Every triangle twice: the winding number is above 1/2 beyond the open side, too.
TriangleMesh doubled(TriangleMesh mesh) {
  const std::vector<TriangleMesh::Triangle> triangles = mesh.triangles;
  mesh.triangles.insert(mesh.triangles.end(), triangles.begin(), triangles.end());
  return mesh;
}

// The same inside, where the box about the mesh ends the inside, too.
TEST(OutsideMargin, SideMarginHoldsNoPlaceOfTheOtherSide) {
  test::Rng rng(182);
  int positive[2] = {}, near_box = 0;
  for (const TriangleMesh& mesh :
       {test::open_box({0.15, 0.1, 0.2}), doubled(test::open_box({0.15, 0.1, 0.2})), perforated(3),
        perforated(1000)}) {
    const Solid solid({GeometryElement{mesh, Eigen::Isometry3d::Identity(), "test"}});
    Eigen::AlignedBox3d box;
    for (const Eigen::Vector3d& vertex : mesh.vertices) box.extend(vertex);
    for (int i = 0; i < test::scaled(3000); ++i) {
      Eigen::Vector3d p = test::random_vector(&rng, i % 2 == 0 ? 0.15 : 0.11);
      // Near the open side of the box, which no surface closes.
      if (i % 3 == 0) p.z() = 0.1 - 0.01 * std::abs(p.z());
      const double distance = std::abs(solid.signed_distance(p).distance);
      const SideMargin found = side_margin(solid, p, distance);
      const SideMargin outside = outside_margin(solid, p, distance);
      ASSERT_EQ(found.is_inside, solid.is_inside(p));
      ASSERT_EQ(found.is_inside, outside.is_inside);
      ASSERT_LE(found.margin, distance);
      ASSERT_EQ(outside.margin, found.is_inside ? 0.0 : found.margin);
      if (!(found.margin > 0.0)) continue;
      ++positive[found.is_inside ? 1 : 0];
      near_box += found.is_inside && box.max().z() - p.z() < 1.001 * found.margin ? 1 : 0;
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

// The field of a straight edge (Biot and Savart).
Eigen::Vector3d field_of(const Eigen::Vector3d& from, const Eigen::Vector3d& along,
                         const Eigen::Vector3d& p) {
  constexpr int kParts = 1000;
  Eigen::Vector3d field = Eigen::Vector3d::Zero();
  for (int i = 0; i < kParts; ++i) {
    const Eigen::Vector3d r = from + (i + 0.5) / kParts * along - p;
    field += r.cross(along / kParts) / std::pow(r.norm(), 3);
  }
  return field;
}

// The field of a short edge falls with the cube of the distance, which the bound of its derivative
// just allows; from afar, where a cluster is seen as a sphere, a little more.
TEST(OutsideMargin, CurvatureOfOneEdge) {
  constexpr double kLength = 1e-3, kStep = 1e-3;
  const Eigen::Vector3d from(0.0, -0.5 * kLength, 0.0), along(0.0, kLength, 0.0);
  const std::vector<OpenEdgeHierarchy::Edge> edges = {{from, from + along}};
  const OpenEdgeHierarchy edge(edges);
  for (const double distance : {0.003, 0.006, 0.01, 1.0}) {
    const Eigen::Vector3d p(distance, 0.0, 0.0);
    const OpenEdgeSums sums = edge.sums(p);
    const Eigen::Vector3d step = kStep * p;
    const Eigen::Vector3d change =
        field_of(from, along, p + step) - field_of(from, along, p - step);
    const double slope = change.norm() / (2.0 * step.norm());
    EXPECT_LE(slope, sums.curvature);
    EXPECT_GT(slope, (distance < 0.005 ? 0.8 : 0.7) * sums.curvature);
    EXPECT_LE(sums.nearest, distance);
    EXPECT_GT(sums.nearest, 0.8 * distance);
  }
}

// Edges in a ball of radius 1; some of them count more than once.
std::vector<OpenEdgeHierarchy::Edge> random_edges(std::size_t count, test::Rng* rng) {
  std::vector<OpenEdgeHierarchy::Edge> edges;
  const double length = count < 10 ? 0.4 : 0.1;
  while (edges.size() < count) {
    const Eigen::Vector3d from = test::random_vector(rng, 0.5);
    const Eigen::Vector3d along =
        test::random_vector(rng, length) + Eigen::Vector3d(0.25 * length, 0.0, 0.0);
    edges.push_back({from, from + along, edges.size() % 5 == 0 ? 2.0 : 1.0});
  }
  return edges;
}

// The field is as wrong as it says, at most: from nearby, where edges are summed up, and from afar,
// where clusters are.
TEST(OutsideMargin, FieldErrorIsBounded) {
  test::Rng rng(184);
  for (const std::size_t count : {1U, 7U, 8U, 9U, 63U, 65U, 300U}) {
    double most_used = 0.0;
    for (int i = 0; i < (count < 10 ? 100 : 20); ++i) {
      const std::vector<OpenEdgeHierarchy::Edge> edges = random_edges(count, &rng);
      const double away = std::pow(10.0, test::uniform(&rng, -1.3, 2.5));
      const Eigen::Vector3d p = (1.0 + away) * test::random_vector(&rng, 1.0).normalized();
      const OpenEdgeSums sums = OpenEdgeHierarchy(edges).sums(p);
      Eigen::Vector3d error(-sums.field[0], -sums.field[1], -sums.field[2]);
      double quadrature = 0.0, nearest = std::numeric_limits<double>::infinity();
      for (const OpenEdgeHierarchy::Edge& edge : edges) {
        const Eigen::Vector3d field = edge.count * field_of(edge.from, edge.to - edge.from, p);
        error += field;
        quadrature += 1e-6 * field.norm();
        nearest = std::min({nearest, (p - edge.from).norm(), (p - edge.to).norm()});
      }
      ASSERT_LE(error.norm(), sums.field_error + quadrature) << count << " edges, " << p.norm();
      ASSERT_LE(sums.nearest, nearest);
      most_used = std::max(most_used, error.norm() / sums.field_error);
    }
    EXPECT_GT(most_used, 0.01) << "the error of " << count << " edges is never so large";
  }
}

// What float loses is within what it says, where many edges of a mesh are near, with every
// instruction set.
void check_many_near_edges() {
  test::Rng rng(185);
  for (int i = 0; i < test::scaled(20); ++i) {
    const std::vector<OpenEdgeHierarchy::Edge> edges = random_edges(2000, &rng);
    const Eigen::Vector3d p = test::random_vector(&rng, 0.6);
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

TEST(OutsideMargin, FieldOfManyNearEdges) { test::for_each_instruction_set(check_many_near_edges); }

// Two sheets whose borders meet in opposite directions change it little, though each one alone
// would: the fields of their edges cancel.
TEST(OutsideMargin, SeamsCancel) {
  TriangleMesh two = fan(7, 0.1);
  TriangleMesh other = fan(9, 0.1 + 1e-5);
  const auto first = static_cast<std::uint32_t>(two.vertices.size());
  two.vertices.insert(two.vertices.end(), other.vertices.begin(), other.vertices.end());
  for (const TriangleMesh::Triangle& t : other.triangles) {
    two.triangles.push_back({first + t[0], first + t[2], first + t[1]});
  }
  constexpr double kChange = 0.2;
  const Eigen::Vector3d p(0.11, 0.0, 0.0);
  const double alone = OpenEdgeHierarchy(fan(7, 0.1)).steady_radius(p, kChange, 0.1);
  const double both = OpenEdgeHierarchy(two).steady_radius(p, kChange, 0.1);
  EXPECT_LT(alone, 0.01);
  EXPECT_GT(both, 0.7 * alone) << "there are twice as many edges";
  test::Rng rng(183);
  check_steady(two, 0.1, &rng);
}

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
