// Lengths, positions and scales from outside have upper limits. Larger numbers are refused by name
// and value: in float their squares would be infinite and a search would meet NaN.

#include "internal/geometry/limits.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <limits>
#include <string>

#include "internal/geometry/mesh_io.h"
#include "internal/packing/packer.h"
#include "ist_proximity/geometry/error.h"
#include "ist_proximity/geometry/solid.h"
#include "ist_proximity/robot/kinematics.h"
#include "ist_proximity/robot/robot_description.h"
#include "ist_proximity/robot/robot_model.h"
#include "support/accuracy.h"
#include "support/errors.h"
#include "support/mesh_files.h"
#include "support/meshes.h"
#include "support/random_links.h"
#include "support/robot_of_links.h"
#include "support/temp_dir.h"

namespace ist {
namespace {

const double kTooLarge[] = {1.0001e4,
                            1e13,
                            1e19,
                            1e39,
                            1e160,
                            1e300,
                            std::numeric_limits<double>::infinity(),
                            std::numeric_limits<double>::quiet_NaN()};

using test::error_of;
using test::expect_says;

RobotDescription parse(const std::string& collision, const std::string& joint = "") {
  return parse_urdf(
      "<robot name='r'><link name='base'>" + collision + "</link>" + joint + "</robot>",
      GeometrySource::kCollision, {});
}

TEST(Limits, ShapesOfAUrdfAreRefusedWithTheirNumbers) {
  for (const double size : kTooLarge) {
    const std::string s = test::number(size);
    if (!std::isfinite(size)) continue;  // urdfdom refuses those words itself
    for (const std::string& shape :
         {"<box size='1 " + s + " 1'/>", "<cylinder radius='1' length='" + s + "'/>",
          "<cylinder radius='" + s + "' length='1'/>", "<sphere radius='" + s + "'/>"}) {
      const RobotDescription robot =
          parse("<collision><geometry>" + shape + "</geometry></collision>");
      ASSERT_EQ(robot.links.size(), 1U);
      expect_says(robot.links[0].error,
                  " is " + s + " m; allowed is more than 0 and at most 10000 m");
      EXPECT_TRUE(robot.links[0].geometry.empty());
    }
    const RobotDescription robot =
        parse("<collision><origin xyz='0 0 " + s +
              "'/><geometry><sphere radius='1'/></geometry></collision>");
    expect_says(robot.links[0].error, "its <origin> is at (0 0 " + s + ") m; allowed are finite");
  }
}

TEST(Limits, NumbersThatNoDoubleHoldsAreRefused) {
  for (const std::string s : {"1e400", "-1e400", "nan", "inf", "1e", "0x", ""}) {
    const RobotDescription robot =
        parse("<collision><geometry><box size='1 1 " + s + "'/></geometry></collision>");
    ASSERT_EQ(robot.links.size(), 1U) << s;
    EXPECT_NE(robot.links[0].error, "") << s;
  }
}

TEST(Limits, JointsOfAUrdfAreRefusedWithTheirNumbers) {
  const std::string joint =
      "<link name='tip'/><joint name='j' type='revolute'><parent link='base'/><child link='tip'/>"
      "<origin xyz='1e160 0 0'/><axis xyz='0 0 1'/><limit lower='-1e300' upper='1e300' effort='1' "
      "velocity='1'/></joint>";
  const RobotDescription robot = parse("", joint);
  expect_says(error_of([&] { Kinematics kinematics(robot); }),
              "joint 'j': its <origin> is at (1e+160");
  EXPECT_EQ(robot.joints[0].lower, -std::numeric_limits<double>::infinity());
  EXPECT_EQ(robot.joints[0].upper, std::numeric_limits<double>::infinity());
}

// The link would otherwise be at 1e300 m, which is infinite in float.
TEST(Limits, ASlideToAnAbsurdPositionLeavesItsLinkUnknown) {
  const RobotDescription robot =
      parse("",
            "<link name='tip'/><joint name='j' type='prismatic'><parent link='base'/><child "
            "link='tip'/><axis xyz='0 0 1'/><limit lower='0' upper='1' effort='1' "
            "velocity='1'/></joint>");
  const Kinematics kinematics(robot);
  JointPoses poses;
  for (const double q : {0.5, 1e300, -1e39, 9999.0}) {
    kinematics.place_joints({q}, &poses);
    EXPECT_EQ(poses.known[0], std::abs(q) < 1e4) << q;
  }
}

TEST(Limits, ScalesAndCornersOfMeshFilesAreRefusedWithTheirNumbers) {
  const test::TempDir dir;
  const std::string file = dir.file("box.stl");
  std::ofstream(file) << test::ascii_stl(test::box(Eigen::Vector3d::Constant(0.1)));
  for (const double scale : kTooLarge) {
    if (scale < 1.1e4) continue;
    const std::string error = error_of([&] { load_mesh(file, {1.0, -scale, 1.0}); });
    expect_says(error, "has the scale (");
    expect_says(error, "at most 10000");
  }
  const std::string far = dir.file("far.stl");
  std::ofstream(far) << test::ascii_stl(test::box(Eigen::Vector3d::Constant(100.0)));
  expect_says(error_of([&] { load_mesh(far, {1.0, 1e4, 1.0}); }), "has a vertex at (");
  EXPECT_EQ(load_mesh(file, {1e4, 1e4, 1e4}).triangles.size(), 12U);
}

// The library's own users make shapes without a URDF.
TEST(Limits, ShapesGivenToTheLibraryAreRefused) {
  for (const double size : kTooLarge) {
    const Shape shapes[] = {Box{{1.0, size, 1.0}}, Cylinder{size, 1.0}, Cylinder{1.0, size},
                            Sphere{size}, test::box(Eigen::Vector3d(1.0, 1.0, size))};
    for (const Shape& shape : shapes) {
      // A mesh box reaches half its size to each side.
      if (std::holds_alternative<TriangleMesh>(shape) && size < 2e4) continue;
      const GeometryElement element{shape, Eigen::Isometry3d::Identity(), "test"};
      EXPECT_THROW(pack_element(shape, {}), ModelError) << size;
      EXPECT_THROW(Solid({element}), ModelError) << size;
      const auto model = build_robot_model(test::robot_of({{element}}), {});
      expect_says(model->links[0].error, "link 'link0', element 'test': ");
    }
  }
}

// Sizes at the limit, and as small as double has them, are ordinary: packed, and with an inside.
TEST(Limits, SizesWithinTheLimitsAreMeasured) {
  for (const double size : {1e4, 1e2, 1e-3, 1e-9, 1e-30, 1e-100}) {
    SCOPED_TRACE(size);
    PackingConfig config;
    config.max_error = 0.05 * size;
    config.max_spheres = 500;
    for (const Shape& shape : {Shape(Box{Eigen::Vector3d::Constant(size)}),
                               Shape(Cylinder{0.5 * size, size}), Shape(Sphere{0.5 * size})}) {
      const Packing packing = pack_element(shape, config);
      EXPECT_FALSE(packing.spheres.empty());
      const Solid solid(test::one(shape));
      EXPECT_NEAR(solid.signed_distance({0.0, 0.0, size}).distance, 0.5 * size, 1e-9 * size);
      if (size > 1e-9) {
        EXPECT_TRUE(solid.is_inside({0.1 * size, 0.1 * size, 0.1 * size}));
      }
      const InnerSphereTree tree(packing);
      EXPECT_LE(tree.cover_distance({0.0, 0.0, size}), 0.5 * size * (1.0 + 1e-6));
      EXPECT_LE(tree.cover_distance({0.1 * size, 0.1 * size, 0.1 * size}), tree.interior_gap());
    }
  }
}

}  // namespace
}  // namespace ist
