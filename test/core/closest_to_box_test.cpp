// Meshes and cylinders against solid boxes: each triangle on its own, and points of both bodies.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "internal/geometry/box_distance.h"
#include "internal/geometry/triangle_bvh.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "support/box_oracle.h"
#include "support/box_truth.h"
#include "support/meshes.h"
#include "support/sanitizers.h"
#include "support/scene.h"

namespace ist {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

// A bumpy sphere: convex here, hollow there.
TriangleMesh bumpy_mesh(test::Rng* rng, int rings, double size) {
  TriangleMesh mesh;
  const double wave = test::uniform(rng, 1.0, 6.0), height = test::uniform(rng, 0.0, 0.3);
  const int sectors = 2 * rings;
  for (int i = 0; i <= rings; ++i) {
    for (int k = 0; k < sectors; ++k) {
      const double a = EIGEN_PI * i / rings, b = 2.0 * EIGEN_PI * k / sectors;
      const Eigen::Vector3d n(std::sin(a) * std::cos(b), std::sin(a) * std::sin(b), std::cos(a));
      mesh.vertices.emplace_back(size * (1.0 + height * std::sin(wave * (a + b))) * n);
    }
  }
  const auto at = [&](int i, int k) {
    return static_cast<std::uint32_t>(i * sectors + k % sectors);
  };
  for (int i = 0; i < rings; ++i) {
    for (int k = 0; k < sectors; ++k) {
      mesh.triangles.push_back({at(i, k), at(i + 1, k), at(i + 1, k + 1)});
      mesh.triangles.push_back({at(i, k), at(i + 1, k + 1), at(i, k + 1)});
    }
  }
  return mesh;
}

double closest_of_all(const TriangleMesh& mesh, const Eigen::AlignedBox3d& box,
                      const Eigen::Isometry3d& X_OM) {
  double least = kInf;
  for (const TriangleMesh::Triangle& t : mesh.triangles) {
    const auto corner = [&](std::size_t k) { return X_OM * mesh.vertices[t[k]]; };
    least = std::min(least, triangle_to_box(corner(0), corner(1), corner(2), box).distance);
  }
  return least;
}

Eigen::AlignedBox3d random_box(test::Rng* rng, double reach) {
  const Eigen::Vector3d center = test::random_vector(rng, reach);
  Eigen::Vector3d half;
  for (int k = 0; k < 3; ++k) half[k] = std::pow(10.0, test::uniform(rng, -3.0, -0.5));
  return Eigen::AlignedBox3d(center - half, center + half);
}

TEST(ClosestToBox, EachTriangleOnItsOwn) {
  test::Rng rng(19);
  int apart = 0, touching = 0, out_of_range = 0;
  for (int i = 0; i < test::scaled(400); ++i) {
    const double size = i % 5 == 0 ? 20.0 : 0.2;
    const TriangleMesh mesh = bumpy_mesh(&rng, 3 + i % 14, size);
    const TriangleBvh bvh(mesh);
    for (int k = 0; k < 20; ++k) {
      // Far away poses are rounded to 1e-13 m, those of float would be to 1e-4 m.
      const double far = k % 4 == 0 ? 1000.0 : 0.0;
      Eigen::AlignedBox3d box = random_box(&rng, 2.0 * size);
      Eigen::Isometry3d X_OM = test::random_pose(&rng, 0.3 * size);
      const Eigen::Vector3d away(far, -far, 0.5 * far);
      box.translate(away);
      X_OM.pretranslate(away);
      const double truth = closest_of_all(mesh, box, X_OM);
      const double limit = k % 3 == 0 ? kInf : test::uniform(&rng, 0.1, 3.0) * size;
      std::optional<Eigen::Vector3d> near_O;
      if (k % 2 == 0) near_O = away + test::random_vector(&rng, (k % 5 == 0 ? 0.1 : 2.0) * size);
      const BoxDistance found = bvh.closest_to_box(box, X_OM, limit, near_O);
      const double rounding = 1e-12 * (size + far) + 1e-12 * truth;
      if (truth >= limit + rounding) {
        EXPECT_EQ(found.distance, kInf);
        ++out_of_range;
        continue;
      }
      ASSERT_NEAR(found.distance, truth, rounding) << "mesh " << i << ", box " << k;
      EXPECT_LE(found.lower_bound, std::min(found.distance, truth + rounding));
      EXPECT_GE(found.lower_bound, (1.0 - 3e-12) * found.distance);
      EXPECT_NEAR((found.p_OS - found.p_OB).norm(), found.distance, rounding);
      (truth > 0.0 ? apart : touching) += 1;
    }
  }
  EXPECT_GT(apart, test::scaled(400) * 4);
  EXPECT_GT(touching, test::scaled(400) / 4);
  EXPECT_GT(out_of_range, test::scaled(400));
}

// Of flat plates that are parallel to the box, bounds of nodes are as large as distances, and a
// limit that is hardly more than the distance leaves no room for rounding.
TEST(ClosestToBox, PlatesAndALimitThatIsHardlyMore) {
  test::Rng rng(21);
  for (int i = 0; i < test::scaled(2000); ++i) {
    TriangleMesh mesh;
    for (std::uint32_t k = 0; k < 40; ++k) {
      const Eigen::Vector3d p = test::random_vector(&rng, 0.5);
      for (const Eigen::Vector3d& corner : {p, Eigen::Vector3d(p.x() + 0.1, p.y(), p.z()),
                                            Eigen::Vector3d(p.x(), p.y() + 0.1, p.z())}) {
        mesh.vertices.push_back(corner);
      }
      mesh.triangles.push_back({3 * k, 3 * k + 1, 3 * k + 2});
    }
    Eigen::AlignedBox3d box = random_box(&rng, 0.4);
    box.translate(Eigen::Vector3d(0, 0, i % 2 == 0 ? 2.0 : -2.0));
    Eigen::Isometry3d X_OM = Eigen::Isometry3d::Identity();
    X_OM.translation() = test::random_vector(&rng, 0.1);
    const double truth = closest_of_all(mesh, box, X_OM);
    const BoxDistance found =
        TriangleBvh(mesh).closest_to_box(box, X_OM, (1.0 + 1e-9) * truth + 1e-12);
    ASSERT_NEAR(found.distance, truth, 1e-12) << "case " << i;
  }
}

Eigen::Vector3d closest_in_cylinder(const Cylinder& cylinder, const Eigen::Vector3d& p) {
  Eigen::Vector3d q = p;
  const double radial = p.head<2>().norm();
  if (radial > cylinder.radius) q.head<2>() *= cylinder.radius / radial;
  q.z() = std::clamp(p.z(), -0.5 * cylinder.length, 0.5 * cylinder.length);
  return q;
}

// Going to and fro between two convex bodies comes as near as they are; the search proves that
// nothing is nearer.
TEST(ClosestToBox, CylindersByAlternatingProjections) {
  test::Rng rng(20);
  for (int i = 0; i < test::scaled(3000); ++i) {
    const Cylinder cylinder{test::uniform(&rng, 0.005, 0.1), test::uniform(&rng, 0.01, 0.6)};
    const Eigen::AlignedBox3d box = random_box(&rng, 0.5);
    Eigen::Isometry3d X_OE = test::random_pose(&rng, 0.3);
    if (i % 4 == 0) X_OE.linear().setIdentity();  // sides, edges and ends are parallel
    if (i % 4 == 1) {
      X_OE.linear() = Eigen::AngleAxisd(1e-7, Eigen::Vector3d::UnitX()).toRotationMatrix();
    }
    Eigen::Vector3d p = box.center(), q = p;
    for (int step = 0; step < 2000; ++step) {
      q = X_OE * closest_in_cylinder(cylinder, X_OE.inverse() * p);
      p = clamp_to(box, q);
    }
    const double reached = (p - q).norm();
    const BoxDistance found = cylinder_to_box(cylinder, X_OE, box);
    ASSERT_LE(found.lower_bound, reached + 1e-12) << "case " << i;
    EXPECT_LE(found.distance - found.lower_bound, 1e-9) << "case " << i;
    EXPECT_LE(found.distance, reached + 1e-9) << "case " << i;
    EXPECT_LE((found.p_OB - clamp_to(box, found.p_OB)).norm(), 1e-15);
    const Eigen::Vector3d p_E = X_OE.inverse() * found.p_OS;
    EXPECT_LE((p_E - closest_in_cylinder(cylinder, p_E)).norm(), 1e-12);
  }
}

// Boxes that are near a link, and inside: which of them are outside is kept while the link moves.

constexpr double kVoxel = 0.008;    // [m] less than the links are thick
constexpr double kMaxError = 0.01;  // [m] the spheres say nothing of boxes that are nearer

std::vector<TriangleMesh> link_meshes() {
  return {test::l_shape(0.2, 0.05), test::torus(0.1, 0.03, 12, 8), test::icosphere(0.08, 1),
          test::thin_plate(0.1, 0.004)};
}

Eigen::AlignedBox3d voxel_at(const Eigen::Vector3d& p) {
  const Eigen::Vector3d low = kVoxel * (p / kVoxel).array().floor();
  return {low, low + Eigen::Vector3d::Constant(kVoxel)};
}

// Single voxels, and a block of some dozens, which a link can hold.
std::vector<Eigen::AlignedBox3d> random_voxels(test::Rng* rng, int count, int block) {
  std::vector<Eigen::AlignedBox3d> boxes;
  for (int i = 0; i < count; ++i) boxes.push_back(voxel_at(test::random_vector(rng, 0.15)));
  const Eigen::Vector3d corner = test::random_vector(rng, 0.05);
  for (int i = 0; i < block * block * block; ++i) {
    boxes.push_back(voxel_at(
        corner + kVoxel * Eigen::Vector3d(i % block, i / block % block, i / block / block)));
  }
  return boxes;
}

// The links go on by up to 4 mm at a time, and are elsewhere now and then.
void move(test::Rng* rng, int step, const Eigen::Vector3d& way, Eigen::Isometry3d* X) {
  if (step % 20 == 0) *X = test::random_pose(rng, 0.12);
  X->translation() += test::uniform(rng, 0.0, 0.004) * way;
  X->rotate(Eigen::AngleAxisd(test::uniform(rng, 0.0, 0.02), way.normalized()));
}

TEST(BoxesInside, AgainstOracleOnTheWay) {
  test::Rng rng(51);
  const std::vector<TriangleMesh> meshes = link_meshes();
  const auto model = test::make_model({meshes.begin(), meshes.end()}, kMaxError);
  QueryConfig config;
  const std::vector<bool> known(meshes.size(), true);
  std::vector<LinkProximity> results;
  std::vector<Eigen::Isometry3d> X_FL(meshes.size());
  int near = 0, contact = 0;
  for (int scene = 0; scene < test::scaled(12); ++scene) {
    config.tolerance = scene % 2 == 0 ? 0.001 : 0.0;
    ProximityQuery query(model, config);
    const CloudSnapshot map =
        test::make_map(random_voxels(&rng, 3 + scene, scene % 5), test::random_pose(&rng, 0.01));
    const Eigen::Vector3d way = test::random_vector(&rng, 1.0).normalized();
    for (int step = 0; step < 60; ++step) {
      for (Eigen::Isometry3d& X : X_FL) move(&rng, step, way, &X);
      query.run(X_FL, known, {&map}, &results);
      for (std::size_t i = 0; i < meshes.size(); ++i) {
        SCOPED_TRACE("scene " + std::to_string(scene) + " step " + std::to_string(step) + " link " +
                     std::to_string(i));
        const test::BoxTruth truth = test::truth_of(meshes[i], map, X_FL[i]);
        ASSERT_NO_FATAL_FAILURE(
            test::expect_truth(results[i], truth, meshes[i], map, X_FL[i], config));
        near += results[i].state == LinkState::kNear;
        if (results[i].state != LinkState::kContact) continue;
        if (++contact % 50 != 0) continue;
        ASSERT_LE(results[i].lower_bound, test::sampled_depth(&rng, meshes[i], map, X_FL[i], 50));
      }
    }
  }
  EXPECT_GT(near, test::scaled(1000));
  EXPECT_GT(contact, test::scaled(500));
}

// Through the opening of a link with holes, boxes are inside in part that touch no triangle.
TEST(BoxesInside, LinkWithHolesAgreesWithAFreshQuery) {
  test::Rng rng(52);
  const auto model = test::make_model({Shape(test::open_box({0.1, 0.1, 0.1}))}, kMaxError);
  const QueryConfig config;
  std::vector<LinkProximity> result, anew;
  int contact = 0;
  for (int scene = 0; scene < test::scaled(100); ++scene) {
    ProximityQuery query(model, config);
    const CloudSnapshot map = test::make_map(random_voxels(&rng, 3 + scene % 20, scene % 5));
    const Eigen::Vector3d way = test::random_vector(&rng, 1.0).normalized();
    Eigen::Isometry3d X;
    for (int step = 0; step < 60; ++step) {
      move(&rng, step, way, &X);
      query.run({&X, 1}, {true}, {&map}, &result);
      ProximityQuery fresh(model, config);
      fresh.run({&X, 1}, {true}, {&map}, &anew);
      ASSERT_LE(result[0].lower_bound, anew[0].distance + 1e-9) << scene << " " << step;
      ASSERT_GE(result[0].distance, anew[0].lower_bound - 1e-9) << scene << " " << step;
      contact += result[0].state == LinkState::kContact ? 1 : 0;
    }
  }
  EXPECT_GT(contact, test::scaled(500));
}

}  // namespace
}  // namespace ist
