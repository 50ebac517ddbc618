#include "ist_proximity/robot/robot_description.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <string>
#include <thread>
#include <variant>
#include <vector>

#include "internal/robot/mesh_size.h"
#include "support/errors.h"
#include "support/mesh_files.h"
#include "support/meshes.h"
#include "support/temp_dir.h"

namespace ist {
namespace {

using test::expect_says;

std::string robot(const std::string& content) {
  return "<?xml version=\"1.0\"?>\n<robot name=\"test\">" + content + "</robot>";
}

std::string fixed_joint(const std::string& parent, const std::string& child) {
  return "<joint name=\"" + parent + "_" + child + "\" type=\"fixed\"><parent link=\"" + parent +
         "\"/><child link=\"" + child + "\"/></joint>";
}

std::string collision(const std::string& shape, const std::string& origin = "") {
  return "<collision>" + origin + "<geometry>" + shape + "</geometry></collision>";
}

// A URDF of a valid link and, below it, the link under test.
std::string with_link(const std::string& content) {
  return robot("<link name=\"good\">" + collision("<sphere radius=\"0.1\"/>") +
               "</link><link name=\"tried\">" + content + "</link>" + fixed_joint("good", "tried"));
}

RobotDescription parse(const std::string& urdf,
                       GeometrySource source = GeometrySource::kCollision) {
  return parse_urdf(urdf, source, {});
}

std::string structure_error(const std::string& urdf) {
  return test::error_of([&] { parse(urdf); });
}

// The error of the link under test; the valid link must be read all the same.
std::string link_error(const std::string& content) {
  const RobotDescription description = parse(with_link(content));
  EXPECT_EQ(description.links.size(), 2U);
  EXPECT_EQ(description.links[0].error, "");
  EXPECT_EQ(description.links[0].geometry.size(), 1U);
  EXPECT_EQ(description.links[1].name, "tried");
  EXPECT_TRUE(description.links[1].geometry.empty());
  const std::string error = description.links[1].error;
  expect_says(error, "link 'tried'");
  return error;
}

TEST(RobotDescription, readsShapesAndOrigins) {
  const RobotDescription description = parse(
      robot("<link name=\"a\">" +
            collision("<box size=\"0.1 0.2 0.3\"/>",
                      "<origin xyz=\"1 2 3\" rpy=\"0 0 1.5707963267948966\"/>") +
            collision("<cylinder radius=\"0.4\" length=\"0.5\"/>", "<origin xyz=\"4 5 6\"/>") +
            collision("<sphere radius=\"0.6\"/>") + "</link>"));
  EXPECT_EQ(description.name, "test");
  EXPECT_EQ(description.root_link, "a");
  ASSERT_EQ(description.links.size(), 1U);
  const LinkGeometry& geometry = description.links[0].geometry;
  ASSERT_EQ(geometry.size(), 3U);
  EXPECT_EQ(std::get<Box>(geometry[0].shape).size, Eigen::Vector3d(0.1, 0.2, 0.3));
  EXPECT_EQ(geometry[0].source, "box");
  const Eigen::Vector3d tip = geometry[0].X_LE * Eigen::Vector3d(1, 0, 0);
  EXPECT_TRUE(tip.isApprox(Eigen::Vector3d(1, 3, 3), 1e-12)) << tip.transpose();
  EXPECT_EQ(std::get<Cylinder>(geometry[1].shape).radius, 0.4);
  EXPECT_EQ(std::get<Cylinder>(geometry[1].shape).length, 0.5);
  EXPECT_EQ(geometry[1].X_LE.translation(), Eigen::Vector3d(4, 5, 6));
  EXPECT_EQ(std::get<Sphere>(geometry[2].shape).radius, 0.6);
  EXPECT_TRUE(geometry[2].X_LE.isApprox(Eigen::Isometry3d::Identity()));
}

// roll, then pitch, then yaw, about fixed axes: R = Rz(yaw) Ry(pitch) Rx(roll).
TEST(RobotDescription, appliesRollPitchYawInThatOrder) {
  const RobotDescription description = parse(
      robot("<link name=\"a\">" +
            collision("<sphere radius=\"1\"/>", "<origin rpy=\"0.3 -0.5 0.7\"/>") + "</link>"));
  using Eigen::AngleAxisd;
  using Eigen::Vector3d;
  const Eigen::Matrix3d expected =
      (AngleAxisd(0.7, Vector3d::UnitZ()) * AngleAxisd(-0.5, Vector3d::UnitY()) *
       AngleAxisd(0.3, Vector3d::UnitX()))
          .toRotationMatrix();
  EXPECT_TRUE(description.links[0].geometry[0].X_LE.linear().isApprox(expected, 1e-12));
}

// urdfdom's map would give a, m, z.
TEST(RobotDescription, keepsTheOrderOfTheDocument) {
  const std::string shape = collision("<sphere radius=\"0.1\"/>");
  const RobotDescription description =
      parse(robot("<link name=\"m\">" + shape + "</link>" + fixed_joint("m", "z") +
                  "<link name=\"z\">" + shape + "</link><link name=\"none\"/><link name=\"a\">" +
                  shape + "</link>" + fixed_joint("z", "a") + fixed_joint("a", "none")));
  ASSERT_EQ(description.links.size(), 3U);
  EXPECT_EQ(description.links[0].name, "m");
  EXPECT_EQ(description.links[1].name, "z");
  EXPECT_EQ(description.links[2].name, "a");
  EXPECT_EQ(description.links_without_geometry, std::vector<std::string>{"none"});
  EXPECT_EQ(description.link_order, (std::vector<std::string>{"m", "z", "none", "a"}));
  EXPECT_EQ(description.root_link, "m");
}

TEST(RobotDescription, fallsBackToVisualGeometry) {
  const std::string visual = "<visual><geometry><sphere radius=\"0.2\"/></geometry></visual>";
  const std::string urdf = with_link(visual);
  const RobotDescription as_collision = parse(urdf, GeometrySource::kCollision);
  ASSERT_EQ(as_collision.links.size(), 2U);
  EXPECT_FALSE(as_collision.links[0].used_visual_fallback);
  EXPECT_TRUE(as_collision.links[1].used_visual_fallback);
  EXPECT_EQ(std::get<Sphere>(as_collision.links[1].geometry.at(0).shape).radius, 0.2);

  const RobotDescription as_visual = parse(urdf, GeometrySource::kVisual);
  ASSERT_EQ(as_visual.links.size(), 1U);
  EXPECT_EQ(as_visual.links[0].name, "tried");
  EXPECT_FALSE(as_visual.links[0].used_visual_fallback);
  EXPECT_EQ(as_visual.links_without_geometry, std::vector<std::string>{"good"});
}

TEST(RobotDescription, ignoresElementsThatAreNoGeometry) {
  const RobotDescription description = parse(robot(
      "<material/><material name=\"x\"><color rgba=\"red\"/></material><gazebo><link/></gazebo>"
      "<link name=\"a\"><inertial><mass value=\"heavy\"/></inertial><visual><geometry>"
      "<sphere radius=\"0.2\"/></geometry><material name=\"undefined\"/></visual></link>"));
  ASSERT_EQ(description.links.size(), 1U);
  EXPECT_EQ(description.links[0].error, "");
}

// A faulty collision element is not replaced by the visual.
TEST(RobotDescription, saysWhatIsWrongWithAnElement) {
  expect_says(link_error(collision("<sphere radius=\"0\"/>") +
                         "<visual><geometry><sphere radius=\"0.2\"/></geometry></visual>"),
              "radius is 0 m");
  expect_says(link_error("<collision/>"), "no <geometry>");
  expect_says(link_error("<collision><geometry/></collision>"), "collision element 1");
  expect_says(link_error(collision("<capsule radius=\"1\"/>")), "'capsule'");
  expect_says(link_error(collision("<box/>")), "size");
  expect_says(link_error(collision("<box size=\"1 2\"/>")), "[1 2]");
  expect_says(link_error(collision("<box size=\"1 2 wide\"/>")), "[wide]");
  expect_says(link_error(collision("<box size=\"1 -2 3\"/>")), "size along y is -2 m");
  expect_says(link_error(collision("<sphere radius=\"big\"/>")), "[big]");
  expect_says(link_error(collision("<cylinder radius=\"1\"/>")), "length");
  expect_says(link_error(collision("<cylinder radius=\"0\" length=\"1\"/>")), "radius is 0 m");
  expect_says(link_error(collision("<sphere radius=\"1\"/>", "<origin xyz=\"0 here 0\"/>")),
              "[here]");
  expect_says(link_error(collision("<sphere radius=\"1\"/>", "<origin rpy=\"0 0\"/>")), "[0 0]");
}

TEST(RobotDescription, saysWhatIsWrongWithAMesh) {
  expect_says(link_error(collision("<mesh/>")), "filename");
  expect_says(link_error(collision("<mesh filename=\"\"/>")), "URI is empty");
  expect_says(link_error(collision("<mesh filename=\"a.stl\"/>")), "relative");
  expect_says(link_error(collision("<mesh filename=\"package://nope/a.stl\"/>")), "package 'nope'");
  expect_says(link_error(collision("<mesh filename=\"file:///nope/a.stl\"/>")),
              "'/nope/a.stl' does not exist");
  expect_says(link_error(collision("<mesh filename=\"/a.stl\" scale=\"1 1\"/>")), "[1 1]");
  expect_says(link_error(collision("<mesh filename=\"/a.stl\" scale=\"1 0 1\"/>")), "(1 0 1)");
}

TEST(RobotDescription, namesEveryFaultyElement) {
  const std::string error =
      link_error(collision("<sphere radius=\"-1\"/>") + collision("<sphere radius=\"1\"/>") +
                 collision("<mesh filename=\"/nope.stl\"/>"));
  expect_says(error, "collision element 1 (sphere)");
  expect_says(error, "collision element 3 (/nope.stl)");
}

TEST(RobotDescription, loadsMeshesWithTheirScale) {
  const test::TempDir dir;
  dir.write("arm/meshes/a b.stl", test::binary_stl(test::box({1, 2, 3})));
  const PackageFinder finder = [&](const std::string& name) {
    return name == "arm" ? dir.file("arm") : "";
  };
  const RobotDescription description =
      parse_urdf(robot("<link name=\"a\">" +
                       collision("<mesh filename=\"package://arm/meshes/a%20b.stl\" "
                                 "scale=\"0.1 0.1 -0.1\"/>") +
                       "</link>"),
                 GeometrySource::kCollision, finder);
  ASSERT_EQ(description.links.at(0).error, "");
  const GeometryElement& element = description.links[0].geometry.at(0);
  EXPECT_EQ(element.source, "package://arm/meshes/a%20b.stl");
  EXPECT_NEAR(test::signed_volume(std::get<TriangleMesh>(element.shape)), 0.006, 1e-9);
}

// Meshes are read on several threads; each element gets its own, and faults come in the URDF's
// order.
TEST(RobotDescription, readsManyMeshesAtOnce) {
  const test::TempDir dir;
  constexpr int kFiles = 12;
  const std::string faulty = dir.write("faulty.stl", "solid");
  std::string content = "<link name=\"root\"/>";
  for (int i = 0; i < 2 * kFiles; ++i) {
    const int size = 1 + i % kFiles;  // every file twice
    const std::string path =
        dir.write("box" + std::to_string(size) + ".stl",
                  test::binary_stl(test::box(Eigen::Vector3d::Constant(0.1 * size))));
    const std::string name = "link" + std::to_string(i);
    content += "<link name=\"" + name + "\">" + collision("<mesh filename=\"" + path + "\"/>");
    if (i % 5 == 0) {
      content +=
          collision("<mesh filename=\"" + faulty + "\"/>") + collision("<sphere radius=\"-1\"/>");
    }
    content += "</link>" + fixed_joint("root", name);
  }
  std::atomic<int> inside{0}, most{0}, calls{0};
  const RobotDescription description =
      parse_urdf(robot(content), GeometrySource::kCollision, {},
                 [&](const std::string& /*link*/, const std::string& /*mesh*/) {
                   most = std::max(most.load(), ++inside);
                   ++calls;
                   std::this_thread::yield();
                   --inside;
                   return true;
                 });
  EXPECT_EQ(most, 1);
  EXPECT_GE(calls, kFiles + 1);
  ASSERT_EQ(description.links.size(), std::size_t{2 * kFiles});
  for (std::size_t i = 0; i < description.links.size(); ++i) {
    const LinkDescription& link = description.links[i];
    EXPECT_EQ(link.name, "link" + std::to_string(i));
    if (i % 5 == 0) {
      EXPECT_TRUE(link.geometry.empty());
      const std::size_t mesh = link.error.find("collision element 2");
      ASSERT_NE(mesh, std::string::npos) << link.error;
      EXPECT_NE(link.error.find("collision element 3", mesh), std::string::npos) << link.error;
      continue;
    }
    ASSERT_EQ(link.geometry.size(), 1U) << link.error;
    double largest = 0.0;
    for (const Eigen::Vector3d& v : std::get<TriangleMesh>(link.geometry[0].shape).vertices) {
      largest = std::max(largest, v.maxCoeff());
    }
    EXPECT_NEAR(largest, 0.05 * static_cast<double>(1 + i % kFiles), 1e-6);
  }
}

TEST(RobotDescription, warnsAboutMeshesInMillimetres) {
  const test::TempDir dir;
  const std::string file = dir.write("a.stl", test::binary_stl(test::box({100, 200, 300})));
  const auto mesh = [&](const std::string& scale) {
    return collision("<mesh filename=\"" + file + "\" scale=\"" + scale + "\"/>");
  };
  const RobotDescription description = parse(robot(
      "<link name=\"right\">" + mesh("0.001 0.001 -0.001") + "</link>" + "<link name=\"floor\">" +
      collision("<box size=\"50 50 0.01\"/>") + "</link>" + "<link name=\"large\">" +
      collision("<sphere radius=\"0.1\"/>") + mesh("1 1 1") + "</link><link name=\"small\">" +
      mesh("1e-6 1e-6 1e-6") + "</link>" + fixed_joint("right", "floor") +
      fixed_joint("right", "large") + fixed_joint("right", "small")));
  const std::vector<std::string> doubts = doubtful_sizes(description);
  ASSERT_EQ(doubts.size(), 2U);
  for (const char* part :
       {"link 'large'", file.c_str(), "100 x 200 x 300 m", "0.001 0.001 0.001"}) {
    expect_says(doubts[0], part);
  }
  for (const char* part : {"link 'small'", "0.0001 x 0.0002 x 0.0003 m", "scaled twice"}) {
    expect_says(doubts[1], part);
  }
  EXPECT_EQ(doubtful_sizes(description, {"small"}).size(), 1U);
  EXPECT_TRUE(doubtful_sizes(description, {"right", "floor"}).empty());
}

TEST(RobotDescription, refusesTextThatIsNoUrdf) {
  expect_says(structure_error(""), "empty");
  expect_says(structure_error(" \n"), "empty");
  expect_says(structure_error("not XML"), "not well-formed");
  // A file's name in place of its content.
  expect_says(structure_error("/opt/robot/arm.urdf.xacro"),
              "begins with '/opt/robot/arm.urdf.xacro'");
  expect_says(structure_error("/opt/robot/arm.urdf.xacro"), "command=\"xacro FILE\"");
  expect_says(structure_error("<robot name=\"a\"><link name=\"b\">"), "not well-formed");
  expect_says(structure_error("<sdf/>"), "<sdf>");
  expect_says(structure_error("<?xml version=\"1.0\"?>"), "no element");
  expect_says(structure_error("<robot/>"), "name");
  expect_says(structure_error(robot("")), "No link");
  expect_says(structure_error(robot("<link/>")), "without a name");
  expect_says(structure_error(robot("<xacro:macro xmlns:xacro=\"x\"/><link name=\"a\"/>")),
              "xacro");
  // urdfdom leaves out what it does not know: here the geometry of a link.
  expect_says(structure_error(robot("<link name=\"a\"><collision><xacro:shape "
                                    "xmlns:xacro=\"x\"/></collision></link><link name=\"b\"/>")),
              "<xacro:shape>; it must be processed by xacro first: `xacro FILE > robot.urdf`");
}

TEST(RobotDescription, refusesJointsThatFormNoTree) {
  const std::string links = "<link name=\"a\"/><link name=\"b\"/><link name=\"c\"/>";
  expect_says(structure_error(robot(links)), "root");
  expect_says(structure_error(robot("<link name=\"a\"/><link name=\"a\"/>")), "'a' is not unique");
  expect_says(structure_error(robot("<link name=\"a\"/>" + fixed_joint("a", "z"))), "[z]");
  expect_says(structure_error(robot("<link name=\"a\"/>" + fixed_joint("a", "a"))), "tree");
  expect_says(structure_error(robot(links + fixed_joint("b", "c") + fixed_joint("c", "b"))),
              "ring");
  expect_says(structure_error(robot(links + fixed_joint("a", "b") + fixed_joint("a", "c") +
                                    fixed_joint("b", "c"))),
              "'c' is the child of joint 'a_c' and of joint 'b_c'");
  expect_says(structure_error(robot(links + fixed_joint("a", "b") +
                                    "<joint name=\"j\" type=\"hinge\"><parent link=\"b\"/>"
                                    "<child link=\"c\"/></joint>")),
              "[hinge]");
}

TEST(RobotDescription, printsNothing) {
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  link_error(collision("<box size=\"1 2 wide\"/>"));
  link_error(collision("<sphere radius=\"1\"/>", "<origin xyz=\"0 here 0\"/>"));
  structure_error(robot("<link name=\"a\"/><link name=\"b\"/>"));
  structure_error(robot("<link name=\"a\"/>" + fixed_joint("a", "z")));
  EXPECT_EQ(testing::internal::GetCapturedStdout(), "");
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

}  // namespace
}  // namespace ist
