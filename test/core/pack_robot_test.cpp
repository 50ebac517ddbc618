// The program pack_robot as users run it, on the demo's arm.

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>
#include <variant>
#include <vector>

#include "ist_proximity/robot/robot_description.h"
#include "support/accuracy.h"
#include "support/scene.h"
#include "support/temp_dir.h"

namespace ist {
namespace {

const std::string kArm = std::string(IST_PROXIMITY_SOURCE_DIR) + "/demo/demo_arm.urdf";
const std::string kMesh = std::string(IST_PROXIMITY_SOURCE_DIR) + "/demo/meshes/shoulder_fork.stl";

std::vector<std::vector<std::string>> csv_rows(const std::string& path) {
  std::istringstream lines(test::read_text(path));
  std::vector<std::vector<std::string>> rows;
  for (std::string line; std::getline(lines, line);) {
    std::istringstream cells(line);
    rows.emplace_back();
    for (std::string cell; std::getline(cells, cell, ',');) rows.back().push_back(cell);
  }
  return rows;
}

class PackRobotTest : public testing::Test {
 protected:
  // Returns the exit code; said_ holds the output.
  int run(const std::string& arguments) {
    const std::string said = dir_.file("said");
    const std::string command = "ROS_PACKAGE_PATH='" + std::string(IST_PROXIMITY_SOURCE_DIR) +
                                "' '" IST_PROXIMITY_PACK_ROBOT "' " + arguments + " > '" + said +
                                "' 2>&1";
    const int status = std::system(command.c_str());  // NOLINT(bugprone-command-processor)
    said_ = test::read_text(said);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  std::string file(const std::string& name) const { return dir_.file(name); }

  test::TempDir dir_;
  std::string said_;
};

TEST_F(PackRobotTest, tableSpheresAndPictureOfARobot) {
  ASSERT_EQ(run(kArm + " --no-cache --max-error 0.02 0.01 --csv " + file("a.csv") + " --ply " +
                file("a.ply") + " --picture " + file("a.png")),
            0)
      << said_;
  const auto rows = csv_rows(file("a.csv"));
  ASSERT_EQ(rows.size(), 19U) << "a header, and nine links at two errors";
  std::size_t spheres = 0;
  for (std::size_t i = 1; i < rows.size(); ++i) {
    ASSERT_EQ(rows[i].size(), rows[0].size());
    EXPECT_NE(said_.find(rows[i][1]), std::string::npos) << rows[i][1];
    const double max_error = std::stod(rows[i][0]), max_gap = std::stod(rows[i][7]);
    EXPECT_LE(max_gap, max_error);
    EXPECT_LE(std::stod(rows[i][8]), max_gap) << "mean";
    EXPECT_LT(std::stod(rows[i][9]), 1e-9) << "protrusion of a closed mesh";
    EXPECT_LE(std::stod(rows[i][6]), std::stod(rows[i][5])) << "filled, of the volume";
    if (i > 9) spheres += std::stoul(rows[i][4]);
  }
  const std::string ply = test::read_text(file("a.ply"));
  EXPECT_NE(ply.find("element vertex " + std::to_string(spheres) + "\n"), std::string::npos);
  EXPECT_EQ(test::read_text(file("a.png")).substr(1, 3), "PNG");
}

// What is inside a link is inside one of its spheres, whichever file they come from.
TEST_F(PackRobotTest, exportedSpheresContainTheLinks) {
  ASSERT_EQ(run(kArm + " --no-cache --max-error 0.02 --export urdf " + file("a.urdf") +
                " --export yaml " + file("a.yaml") + " --export curobo " + file("c.yaml")),
            0)
      << said_;
  EXPECT_NE(said_.find("coverage"), std::string::npos) << said_;
  const auto find_package = [](const std::string&) { return IST_PROXIMITY_SOURCE_DIR; };
  const RobotDescription arm =
      parse_urdf(test::read_text(kArm), GeometrySource::kCollision, find_package);
  const RobotDescription balls =
      parse_urdf(test::read_text(file("a.urdf")), GeometrySource::kCollision, find_package);
  ASSERT_EQ(balls.links.size(), arm.links.size());
  EXPECT_EQ(balls.joints.size(), arm.joints.size());
  test::Rng rng(3);
  for (std::size_t i = 0; i < arm.links.size(); ++i) {
    ASSERT_EQ(balls.links[i].name, arm.links[i].name);
    const Solid solid(arm.links[i].geometry), spheres(balls.links[i].geometry);
    EXPECT_GT(balls.links[i].geometry.size(), 1U);
    int inside = 0;
    for (int k = 0; k < 4000; ++k) {
      const Eigen::Vector3d p_L(test::uniform(&rng, -0.4, 0.4), test::uniform(&rng, -0.4, 0.4),
                                test::uniform(&rng, -0.4, 0.4));
      // A point that is just inside is where a sphere is most likely to fail to reach.
      const SignedDistance near = solid.signed_distance(p_L);
      const Eigen::Vector3d p_LC = near.witness - 1e-6 * near.normal;
      for (const Eigen::Vector3d& p : {p_L, p_LC}) {
        if (!solid.is_inside(p)) continue;
        ++inside;
        EXPECT_TRUE(spheres.is_inside(p)) << arm.links[i].name << " " << p.transpose();
      }
    }
    EXPECT_GT(inside, 2000);
    for (const std::string& name : {file("a.yaml"), file("c.yaml")}) {
      const std::string text = test::read_text(name);
      const std::size_t begin = text.find('"' + arm.links[i].name + "\":");
      ASSERT_NE(begin, std::string::npos) << name;
    }
    for (const GeometryElement& element : balls.links[i].geometry) {
      ASSERT_TRUE(std::holds_alternative<Sphere>(element.shape));
    }
  }
  const auto count = [&](const std::string& name) {
    const std::string text = test::read_text(name), what = "radius: ";
    std::size_t found = 0;
    for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) {
      ++found;
    }
    return found;
  };
  std::size_t all = 0;
  for (const LinkDescription& link : balls.links) all += link.geometry.size();
  EXPECT_EQ(count(file("a.yaml")), all);
  EXPECT_EQ(count(file("c.yaml")), all);
  EXPECT_NE(run(kArm + " --export obj " + file("a.obj")), 0);
  EXPECT_NE(said_.find("curobo"), std::string::npos) << said_;
  EXPECT_EQ(run(kArm + " --no-cache --export yaml /nowhere/a.yaml"), 1);
  EXPECT_NE(said_.find("/nowhere/a.yaml"), std::string::npos) << said_;
}

TEST_F(PackRobotTest, anyNumberOfThreadsGivesTheSameSpheres) {
  for (const std::string order : {"medial", "disjoint", "volume"}) {
    std::vector<std::string> spheres;
    for (const std::string threads : {"1", "5"}) {
      ASSERT_EQ(run(kArm + " --no-cache --max-error 0.02 --order " + order + " --threads " +
                    threads + " --ply " + file("a.ply")),
                0)
          << said_;
      spheres.push_back(test::read_text(file("a.ply")));
    }
    EXPECT_EQ(spheres[0], spheres[1]) << order;
  }
}

TEST_F(PackRobotTest, aMeshIsReadFromTheCacheTheSecondTime) {
  // The mesh is in millimetres, so read in metres it is as large as a house.
  const std::string arguments = kMesh + " --max-error 5 --cache " + file("cache") + " --ply ";
  ASSERT_EQ(run(arguments + file("a.ply")), 0) << said_;
  EXPECT_EQ(said_.find("(cache)"), std::string::npos) << said_;
  ASSERT_EQ(run(arguments + file("b.ply")), 0) << said_;
  EXPECT_NE(said_.find("(cache)"), std::string::npos) << said_;
  EXPECT_EQ(test::read_text(file("a.ply")), test::read_text(file("b.ply")));
}

TEST_F(PackRobotTest, saysWhatIsWrong) {
  EXPECT_EQ(run(file("nowhere.stl")), 1);
  EXPECT_NE(said_.find("nowhere.stl"), std::string::npos) << said_;
  EXPECT_EQ(run("package://no_such_package/robot.urdf"), 1);
  EXPECT_NE(said_.find("no_such_package"), std::string::npos) << said_;
  EXPECT_NE(run(kMesh + " --order largest"), 0);
  EXPECT_NE(said_.find("disjoint"), std::string::npos) << said_;
  EXPECT_NE(run(kMesh + " --max-error -1"), 0);
  EXPECT_EQ(run(kMesh + " --no-cache --max-error 10 --picture /nowhere/a.png"), 1);
  EXPECT_NE(said_.find("/nowhere/a.png"), std::string::npos) << said_;
}

TEST_F(PackRobotTest, reportsAFaultyLinkAndPacksTheOthers) {
  std::ofstream(file("half.urdf")) << R"(<robot name="half">
    <link name="good"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
    <link name="bad"><collision><geometry><mesh filename="file:///nowhere.stl"/></geometry>
      </collision></link>
    <joint name="j" type="fixed"><parent link="good"/><child link="bad"/></joint></robot>)";
  EXPECT_EQ(run(file("half.urdf") + " --no-cache"), 1);
  EXPECT_NE(said_.find("nowhere.stl"), std::string::npos) << said_;
  EXPECT_NE(said_.find("good"), std::string::npos) << said_;
}

// It said that the file "cannot be read as a mesh".
TEST_F(PackRobotTest, xacroIsNamedAsSuch) {
  const std::string xacro = file("arm.urdf.xacro");
  std::ofstream(xacro) << "<robot xmlns:xacro=\"http://www.ros.org/wiki/xacro\" name=\"a\"/>";
  EXPECT_NE(run(xacro), 0);
  EXPECT_NE(said_.find("is a xacro file; expand it first: xacro '" + xacro + "' > robot.urdf"),
            std::string::npos)
      << said_;
}

}  // namespace
}  // namespace ist
