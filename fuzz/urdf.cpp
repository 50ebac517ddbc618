// URDF text: what is read is a tree of bodies, its kinematics place every body, shapes have exact
// distances, and no body is farther away than the kinematic reach says.
// Covers: src/robot/robot_description.cpp src/robot/urdf_document.cpp src/robot/urdf_conversion.cpp
// Covers: src/robot/urdfdom_parser.cpp
// Covers: src/robot/kinematics.cpp src/robot/robot_region.cpp
// Longest input: 1500

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <set>
#include <string>
#include <variant>
#include <vector>

#include "ist_proximity/geometry/error.h"
#include "ist_proximity/geometry/solid.h"
#include "ist_proximity/robot/kinematics.h"
#include "ist_proximity/robot/link_poses.h"
#include "ist_proximity/robot/robot_description.h"
#include "support/check.h"
#include "support/shape_oracle.h"

namespace {

constexpr double kOrdinary = 100.0;  // [m] beyond it rounding is no longer compared

void check_names(const ist::RobotDescription& robot) {
  const std::set<std::string> links(robot.link_order.begin(), robot.link_order.end());
  FUZZ_CHECK(links.size() == robot.link_order.size(), "a link is there twice");
  FUZZ_CHECK(links.count(robot.root_link) == 1, "root link '%s'", robot.root_link.c_str());
  FUZZ_CHECK(robot.links.size() + robot.links_without_geometry.size() == links.size(),
             "%zu + %zu links of %zu", robot.links.size(), robot.links_without_geometry.size(),
             links.size());
  std::set<std::string> children;
  for (const ist::JointDescription& joint : robot.joints) {
    FUZZ_CHECK(links.count(joint.parent_link) == 1 && links.count(joint.child_link) == 1,
               "joint '%s' between unknown links", joint.name.c_str());
    FUZZ_CHECK(children.insert(joint.child_link).second, "link '%s' is a child twice",
               joint.child_link.c_str());
  }
  FUZZ_CHECK(children.size() + 1 == links.size(), "%zu joints, %zu links", children.size(),
             links.size());
}

void check_shapes(const ist::LinkDescription& link) {
  FUZZ_CHECK(link.error.empty() || link.geometry.empty(), "faulty and with geometry");
  if (link.geometry.empty()) return;
  double size = 0.0;
  for (const ist::GeometryElement& element : link.geometry) {
    if (std::holds_alternative<ist::TriangleMesh>(element.shape)) return;
    size = std::max(
        size, element.X_LE.translation().norm() + std::visit(
                                                      [](const auto& s) {
                                                        return ist::test::oracle_signed_distance(
                                                            s, Eigen::Vector3d(1e-3, 2e-3, 3e-3));
                                                      },
                                                      element.shape));
    FUZZ_CHECK(element.X_LE.matrix().allFinite(), "an element's pose is not finite");
  }
  const ist::Solid solid(link.geometry);
  const Eigen::Vector3d p(0.3, -0.2, 0.7);
  const double found = solid.signed_distance(p).distance;
  const double truth = ist::test::oracle_signed_distance(link.geometry, p);
  if (!(size < kOrdinary && std::abs(truth) < kOrdinary)) return;
  FUZZ_CHECK(std::abs(found - truth) < 1e-9 * (1.0 + kOrdinary), "distance %.12g, truth %.12g",
             found, truth);
}

void check_kinematics(const ist::RobotDescription& robot) {
  const ist::Kinematics kinematics(robot);
  FUZZ_CHECK(kinematics.bodies().size() == robot.link_order.size(), "%zu bodies",
             kinematics.bodies().size());
  const std::vector<double> q(kinematics.joints().size(), 0.5);
  ist::JointPoses joints;
  kinematics.place_joints(q, &joints);
  ist::BodyPoses bodies;
  kinematics.place_bodies(joints, Eigen::Isometry3d::Identity(), &bodies);
  const double reach = ist::kinematic_reach(ist::RobotModel(), kinematics);
  FUZZ_CHECK(!std::isnan(reach) && reach >= 0.0, "reach %g", reach);
  for (std::size_t b = 0; b < bodies.known.size(); ++b) {
    if (!bodies.known[b]) continue;
    const Eigen::Matrix4d& X = bodies.X_FB[b].matrix();
    FUZZ_CHECK(X.allFinite() || X.cwiseAbs().maxCoeff() > kOrdinary, "body %zu: pose is NaN", b);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  // Mesh files are another target's; here none is found.
  if (text.find("file:") != std::string::npos || text.find("filename=\"/") != std::string::npos ||
      text.find("filename='/") != std::string::npos) {
    return 0;
  }
  const auto no_package = [](const std::string&) { return std::string(); };
  try {
    const ist::RobotDescription robot =
        ist::parse_urdf(text, ist::GeometrySource::kCollision, no_package);
    check_names(robot);
    for (const ist::LinkDescription& link : robot.links) check_shapes(link);
    check_kinematics(robot);
  } catch (const ist::ModelError& error) {
    FUZZ_CHECK(error.what()[0] != '\0', "no reason");
  }
  return 0;
}
