// MoveIt scenes: what is read, and what is refused.

#include "ist_proximity/proximity/world_file.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <string>
#include <variant>

#include "ist_proximity/geometry/solid.h"
#include "support/errors.h"
#include "support/temp_dir.h"

namespace ist {
namespace {

// As rviz of MoveIt 1.1 writes it.
constexpr const char* kNew = R"((noname)+
* a table
1 2 3
0 0 0 1
2
box
1.5 1 0.1
0 0 0.5
0 0 0 1
0 0 0 0
cylinder
0.05 0.5
0 0 0.25
0 0 0.70710678118 0.70710678118
1 0 0 1
1
corner
0.75 0.5 0.1
0 0 0 1
* ball
0 0 1
0 0 0 1
1
sphere
0.2
0 0 0
0 0 0 1
0 0 0 0
0
.
)";

// Without the objects' poses and subframes.
constexpr const char* kOld = R"(cell
* pyramid
1
mesh
4 4
0 0 0
1 0 0
0 1 0
0 0 1
0 2 1
0 1 3
1 2 3
2 0 3
0.5 0 0
0 0 0 1
0 0 0 0
.
)";

TEST(WorldFile, ReadsAScene) {
  const SceneFile scene = parse_scene(kNew, "world");
  ASSERT_EQ(scene.fault, "");
  ASSERT_EQ(scene.objects.size(), 2U);
  const WorldObject& table = scene.objects[0];
  EXPECT_EQ(table.name, "a table");
  EXPECT_EQ(table.frame, "world");
  EXPECT_EQ(table.X_BO.translation(), Eigen::Vector3d(1, 2, 3));
  ASSERT_EQ(table.geometry.size(), 2U);
  EXPECT_EQ(std::get<Box>(table.geometry[0].shape).size, Eigen::Vector3d(1.5, 1.0, 0.1));
  EXPECT_EQ(table.geometry[0].X_LE.translation().z(), 0.5);
  EXPECT_EQ(std::get<Cylinder>(table.geometry[1].shape).length, 0.5);
  EXPECT_NEAR(table.geometry[1].X_LE.linear()(1, 0), 1.0, 1e-9);
  EXPECT_EQ(scene.objects[1].name, "ball");
  EXPECT_EQ(scene.objects[1].X_BO.translation().z(), 1.0);
}

TEST(WorldFile, ReadsAnOldScene) {
  const SceneFile scene = parse_scene(kOld, "world");
  ASSERT_EQ(scene.fault, "");
  ASSERT_EQ(scene.objects.size(), 1U);
  EXPECT_TRUE(scene.objects[0].X_BO.isApprox(Eigen::Isometry3d::Identity()));
  EXPECT_EQ(std::get<TriangleMesh>(scene.objects[0].geometry[0].shape).triangles.size(), 4U);
  EXPECT_EQ(scene.objects[0].geometry[0].X_LE.translation().x(), 0.5);
}

std::string fault_of(std::string text, const std::string& part, const std::string& with,
                     const WorldLimits& limits = {}) {
  const std::size_t at = text.find(part);
  EXPECT_NE(at, std::string::npos);
  text.replace(at, part.size(), with);
  const SceneFile scene = parse_scene(text, "world", limits);
  EXPECT_TRUE(scene.objects.empty());
  return scene.fault;
}

TEST(WorldFile, NamesTheLineAndTheValue) {
  test::expect_says(fault_of(kNew, "1.5 1 0.1", "1.5 nan 0.1"), "'nan' is no finite number");
  test::expect_says(fault_of(kNew, "1.5 1 0.1", "1.5 0 0.1"), "size along y is 0 m");
  test::expect_says(fault_of(kNew, "1.5 1 0.1", "1e5 1 0.1"), "10000 m");
  test::expect_says(fault_of(kNew, "sphere", "octopus"), "'octopus' is no shape");
  test::expect_says(fault_of(kNew, "0.70710678118 0.70710678118", "0.5 0.5"), "quaternion");
  test::expect_says(fault_of(kNew, ".\n", ""), "it ends where");
  test::expect_says(fault_of(kOld, "0 2 1", "0 2 4"), "a vertex's number is 4");
  test::expect_says(fault_of(kOld, "4 4", "4 1000000000"), "the number of triangles");
  test::expect_says(fault_of(kOld, "4 4", "0 4"), "needs vertices");
  test::expect_says(fault_of(kNew, "* ball", "ball"), "'ball' comes where");
  test::expect_says(parse_scene("", "world").fault, "it is empty");
  test::expect_says(parse_scene("\n\n", "world").fault, "it is empty");
  WorldLimits limits;
  limits.max_objects = 2;
  test::expect_says(fault_of(kNew, "* ball", "* ball", limits), "the number of shapes is 1.0");
  limits.max_triangles = 3;
  test::expect_says(fault_of(kOld, "pyramid", "p", limits), "the number of triangles");
}

// Whatever a file is cut to, it is refused, and never a part of it used.
TEST(WorldFile, RefusesWhatIsCutOff) {
  for (const std::string text : {kNew, kOld}) {
    for (std::size_t size = 0; size + 2 < text.size(); ++size) {
      const SceneFile scene = parse_scene(text.substr(0, size), "world");
      EXPECT_NE(scene.fault, "") << size;
      EXPECT_TRUE(scene.objects.empty()) << size;
    }
  }
}

TEST(WorldFile, ReadsAFile) {
  const test::TempDir folder;
  const std::string path = folder.file("cell.scene");
  EXPECT_NE(read_scene_file(path, "world").fault.find(path), std::string::npos);
  std::ofstream(path) << kNew;
  EXPECT_EQ(read_scene_file(path, "world").objects.size(), 2U);
}

// The mesh encloses the cone, and is near to it.
TEST(WorldFile, AConeIsEnclosed) {
  const Solid solid({GeometryElement{cone(0.5, 2.0), Eigen::Isometry3d::Identity(), "cone"}});
  EXPECT_TRUE(solid.is_closed());
  for (int i = 0; i < 1000; ++i) {
    const double angle = 0.0173 * i, height = 0.001 * i;  // of the surface, from the base
    const double radius = 0.5 * (1.0 - height);
    const Eigen::Vector3d p(radius * std::cos(angle), radius * std::sin(angle), 2.0 * height - 1.0);
    const double distance = solid.signed_distance(p).distance;
    EXPECT_LE(distance, 1e-8);  // float chooses the triangle of a point on the surface
    EXPECT_GE(distance, -3.1e-4 * 0.5);
  }
}

TEST(WorldFile, AHalfSpaceLiesBelowItsPlane) {
  const Eigen::Vector3d n = Eigen::Vector3d(1.0, 2.0, 2.0) / 3.0;
  const Solid solid({half_space(n, 0.5)});
  EXPECT_NEAR(solid.signed_distance(0.8 * n).distance, 0.3, 1e-12);
  EXPECT_NEAR(solid.signed_distance(0.3 * n).distance, -0.2, 1e-12);
}

}  // namespace
}  // namespace ist
