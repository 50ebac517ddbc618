#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "internal/proximity/planning_scene.h"

/// Messages moveit_msgs/PlanningScene, byte by byte as their definition says.
namespace ist::test {

using WirePose = std::array<double, 7>;  ///< x, y, z and a quaternion x, y, z, w
constexpr WirePose kIdentityPose = {0, 0, 0, 0, 0, 0, 1};
constexpr WirePose kUnsetPose = {0, 0, 0, 0, 0, 0, 0};

/// A moveit_msgs/CollisionObject.
struct WireObject {
  struct Primitive {
    unsigned type;
    std::vector<double> dimensions;
  };
  struct Mesh {
    std::vector<std::array<std::uint32_t, 3>> triangles;
    std::vector<std::array<double, 3>> vertices;
  };
  std::string frame, id;
  WirePose pose = kUnsetPose;
  std::vector<Primitive> primitives = {};
  std::vector<WirePose> primitive_poses = {};
  std::vector<Mesh> meshes = {};
  std::vector<WirePose> mesh_poses = {};
  std::vector<std::array<double, 4>> planes = {};
  std::vector<WirePose> plane_poses = {};
  unsigned operation = 0;

  std::vector<std::uint8_t> bytes(SceneLayout layout) const;
};

WireObject box_object(const std::string& id, const WirePose& pose, double edge = 0.2);

/// An octomap_msgs/OctomapWithPose.
struct WireOctomap {
  std::string frame = "map";
  WirePose origin = kIdentityPose;
  bool is_binary = true;
  std::string id = {};
  double resolution = 0.05;
  std::vector<std::uint8_t> data = {};
};

/// An octomap of one leaf, from (0, 0, 0) to its resolution in x, y and z.
WireOctomap one_leaf(double resolution = 0.05);

/// A moveit_msgs/PlanningScene with something in every field.
struct WireScene {
  std::vector<WireObject> objects = {};
  std::vector<WireObject> attached = {};
  std::vector<std::string> matrix_names = {};
  std::vector<std::vector<int>> matrix = {};
  WireOctomap octomap = {};
  bool is_state_diff = true;
  bool is_diff = false;

  std::vector<std::uint8_t> bytes(SceneLayout layout) const;
};

}  // namespace ist::test
