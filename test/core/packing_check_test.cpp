// A cached packing is checked against its shape. Every packing that the packer makes passes, and
// forgeries that a checksum cannot show do not.

#include "internal/packing/packing_check.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "internal/packing/packer.h"
#include "internal/packing/packing_cache.h"
#include "ist_proximity/robot/robot_model.h"
#include "support/errors.h"
#include "support/meshes.h"
#include "support/random_links.h"
#include "support/robot_of_links.h"
#include "support/temp_dir.h"

namespace ist {
namespace {

namespace fs = std::filesystem;
constexpr PackingOrder kOrders[] = {PackingOrder::kMedial, PackingOrder::kDisjoint,
                                    PackingOrder::kVolume};

TEST(PackingCheck, EveryOrderAndNumberOfSpheresPasses) {
  const Shape shapes[] = {
      test::torus(0.1, 0.03, 48, 24), test::l_shape(0.2, 0.05), test::open_box({0.1, 0.1, 0.2}),
      Box{{0.1, 0.2, 0.3}},           Cylinder{0.05, 0.4},      Sphere{0.1}};
  for (const Shape& shape : shapes) {
    for (const PackingOrder order : kOrders) {
      for (const int max_spheres : {1, 30, 300}) {
        PackingConfig config;
        config.order = order;
        config.max_spheres = max_spheres;
        const Packing packing = pack_element(shape, config);
        EXPECT_EQ(packing_fault(shape, config, packing), "")
            << shape.index() << " " << static_cast<int>(order) << " " << max_spheres;
      }
    }
  }
}

class ForgedPackingTest : public testing::Test {
 protected:
  ForgedPackingTest() : packing_(pack_element(shape_, config_)) {
    EXPECT_GT(packing_.spheres.size(), 20U);
    EXPECT_EQ(packing_fault(shape_, config_, packing_), "");
  }

  // A sphere of the surface with a volume, whose cover some of the surface depends on.
  std::size_t surface_sphere() const {
    std::size_t best = 0;
    for (std::size_t i = 0; i < packing_.spheres.size(); ++i) {
      const InnerSphere &a = packing_.spheres[i], &b = packing_.spheres[best];
      if (a.radius > 0.0 && a.cover_radius - a.radius > b.cover_radius - b.radius) best = i;
    }
    return best;
  }

  template <class Change>
  void expect_fault(const std::string& part, const Change& change) {
    Packing forged = packing_;
    change(&forged);
    test::expect_says(packing_fault(shape_, config_, forged), part);
  }

  const Shape shape_ = test::l_shape(0.2, 0.05);
  PackingConfig config_;
  Packing packing_;
};

// The finding: bounds of +20 mm for a point 10 mm inside.
TEST_F(ForgedPackingTest, CoversThatLeaveThePackingAreFound) {
  expect_fault("its cover spheres miss", [&](Packing* forged) {
    forged->spheres[surface_sphere()].cover_radius = forged->spheres[surface_sphere()].radius;
  });
  expect_fault("its cover spheres miss", [&](Packing* forged) {
    forged->spheres.erase(forged->spheres.begin() + static_cast<std::ptrdiff_t>(surface_sphere()));
  });
  expect_fault("its cover spheres miss", [&](Packing* forged) { forged->spheres.resize(1); });
  expect_fault("its cover spheres miss", [&](Packing* forged) {
    for (InnerSphere& sphere : forged->spheres) sphere.cover_radius = std::max(0.0, sphere.radius);
  });
}

TEST_F(ForgedPackingTest, InnerSpheresOutsideAreFound) {
  expect_fault("through the surface", [&](Packing* forged) {
    forged->spheres[0].radius += 1e-6;
    forged->spheres[0].cover_radius += 1e-6;
  });
  expect_fault("through the surface",
               [&](Packing* forged) { forged->spheres[3].center.x() += 0.02; });
  expect_fault("not in the shape", [&](Packing* forged) {
    forged->spheres.push_back({{0.5, 0.5, 0.5}, 1e-3, 1e-3});
  });
  expect_fault("not in the shape", [&](Packing* forged) {
    forged->spheres.push_back({{0.5, 0.5, 0.5}, 0.0, 1e-3});
  });
  expect_fault("has the cover radius",
               [&](Packing* forged) { forged->spheres[0].cover_radius = 1e9; });
  expect_fault("has the cover radius", [&](Packing* forged) {
    forged->spheres[0].cover_radius = std::numeric_limits<double>::quiet_NaN();
  });
}

TEST_F(ForgedPackingTest, NumbersOfTheCertificateAreFound) {
  expect_fault("its interior gap", [](Packing* forged) { forged->certificate.interior_gap = 0.0; });
  expect_fault("its certificate", [](Packing* forged) { forged->certificate.max_gap *= 0.5; });
  expect_fault("its certificate", [](Packing* forged) { forged->certificate.max_gap *= 2.0; });
  expect_fault("its certificate", [](Packing* forged) { forged->certificate.surface_area *= 1.1; });
  expect_fault("its certificate", [](Packing* forged) { forged->certificate.reached = false; });
}

TEST_F(ForgedPackingTest, TooManySpheresAreFound) {
  config_.max_spheres = static_cast<int>(packing_.spheres.size()) - 1;
  expect_fault("packing/max_spheres is", [](Packing*) {});
  expect_fault("it holds 0 spheres", [](Packing* forged) { forged->spheres.clear(); });
}

TEST_F(ForgedPackingTest, OverlapIsFoundInDisjointPackings) {
  config_.order = PackingOrder::kDisjoint;
  packing_ = pack_element(shape_, config_);
  expect_fault("overlaps another",
               [](Packing* forged) { forged->spheres.push_back(forged->spheres[0]); });
}

// A large part without spheres: its surface is covered by points on it, its interior by nothing.
TEST(PackingCheck, AnInteriorThatIsNotCoveredIsFound) {
  const TriangleMesh mesh = test::icosphere(0.2, 4);
  PackingConfig config;
  config.max_error = 0.02;
  config.max_spheres = 100000;
  const Packing whole = pack_mesh(mesh, config);
  ASSERT_EQ(packing_fault(mesh, config, whole), "");
  Packing hollow;
  const double area = test::surface_area(mesh);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Eigen::Vector3d &a = mesh.corner(t, 0), &b = mesh.corner(t, 1), &c = mesh.corner(t, 2);
    ASSERT_LE(std::max((b - a).norm(), (c - a).norm()), config.max_error);
    hollow.spheres.push_back({a, 0.0, config.max_error});
  }
  hollow.certificate = {config.max_error, config.max_error, config.max_error, area, area, true};
  test::expect_says(packing_fault(mesh, config, hollow), "do not reach all of the interior");
  hollow.certificate.interior_gap = 0.2;  // a true statement
  EXPECT_EQ(packing_fault(mesh, config, hollow), "");
}

// A forged file with a right checksum: it is told, packed again and replaced.
TEST(PackingCheck, ARobotIsPackedAgainWhereItsCacheIsForged) {
  const test::TempDir dir;
  const RobotDescription robot = test::robot_of({test::one(test::l_shape(0.2, 0.05))});
  RobotModelConfig config;
  config.cache_directory = dir.file("cache");
  std::vector<std::string> warnings;
  RobotModelCallbacks callbacks;
  callbacks.warning = [&](const std::string& warning) { warnings.push_back(warning); };
  const auto packed = build_robot_model(robot, config, callbacks);
  ASSERT_TRUE(warnings.empty());
  EXPECT_TRUE(build_robot_model(robot, config, callbacks)->links[0].from_cache);

  const Shape& shape = robot.links[0].geometry[0].shape;
  Packing forged = packed->links[0].packing;
  forged.spheres.resize(1);
  forged.spheres[0].center.setConstant(1e300);
  const PackingCache cache(config.cache_directory);
  std::string problem;
  ASSERT_TRUE(cache.store(packing_key(shape, config.packing), forged, &problem)) << problem;
  const auto again = build_robot_model(robot, config, callbacks);
  EXPECT_FALSE(again->links[0].from_cache);
  EXPECT_EQ(again->links[0].packing.spheres.size(), packed->links[0].packing.spheres.size());
  ASSERT_EQ(warnings.size(), 1U);
  test::expect_says(warnings[0], "is not used: ");
  EXPECT_TRUE(build_robot_model(robot, config, callbacks)->links[0].from_cache);
}

TEST(PackingCheck, CanBeCancelled) {
  const Shape shape = test::l_shape(0.2, 0.05);
  PackingConfig config;
  config.max_error = 5e-4;
  const Packing packing = pack_element(shape, config);
  int asked = 0;
  EXPECT_EQ(packing_fault(shape, config, packing, [&](double) { return ++asked < 3; }),
            "its check was cancelled");
  EXPECT_LE(asked, 3);
}

}  // namespace
}  // namespace ist
