// moveit_msgs/PlanningScene from its bytes: what is read, and what is refused.

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <variant>
#include <vector>

#include "internal/proximity/planning_scene.h"
#include "ist_proximity/geometry/solid.h"
#include "support/planning_scene_bytes.h"
#include "support/scene.h"

namespace ist {
namespace {

using test::box_object;
using test::kIdentityPose;
using test::kUnsetPose;
using test::one_leaf;
using test::WireObject;
using test::WireOctomap;
using test::WirePose;
using test::WireScene;
using Operation = SceneObject::Operation;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr SceneLayout kLayouts[] = {SceneLayout::kShapePoses, SceneLayout::kObjectPose};

PlanningScene read(const WireScene& scene, SceneLayout layout = SceneLayout::kObjectPose,
                   const WorldLimits& limits = {}) {
  const std::vector<std::uint8_t> bytes = scene.bytes(layout);
  return read_planning_scene(bytes, layout, limits);
}

WireObject every_shape() {
  WireObject object;
  object.frame = "world";
  object.id = "all";
  object.primitives = {{1, {0.1, 0.2, 0.3}}, {2, {0.4}}, {3, {0.5, 0.06}}, {4, {0.7, 0.08}}};
  object.primitive_poses = {{1, 0, 0, 0, 0, 0, 1}, {2, 0, 0, 0, 0, 0, 1}, {3, 0, 0, 0, 0, 0, 1}};
  object.meshes = {{{{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}},
                    {{0, 0, 0}, {0.1, 0, 0}, {0, 0.1, 0}, {0, 0, 0.1}}}};
  object.mesh_poses = {{0, 5, 0, 0, 0, std::sqrt(0.5), std::sqrt(0.5)}};
  object.planes = {{0, 0, 2, 1}};
  object.plane_poses = {kIdentityPose};
  return object;
}

TEST(PlanningScene, Md5SumsOfTheTwoLayouts) {
  EXPECT_EQ(scene_layout("89aac6d20db967ba716cba5a86b1b9d5"), SceneLayout::kShapePoses);
  EXPECT_EQ(scene_layout("acfc50bcfd6c7b978066bfa7c786002c"), SceneLayout::kObjectPose);
  EXPECT_FALSE(scene_layout("00000000000000000000000000000000"));
  EXPECT_FALSE(scene_layout("*"));
}

TEST(PlanningScene, EveryShapeIsWhereItsPosesSay) {
  for (const SceneLayout layout : kLayouts) {
    WireScene wire;
    WireObject object = every_shape();
    object.pose = {0, 0, 10, 0, 0, 0, 1};
    wire.objects = {object, box_object("box", kIdentityPose)};
    const PlanningScene scene = read(wire, layout);
    ASSERT_EQ(scene.fault, "");
    EXPECT_TRUE(scene.notes.empty());
    EXPECT_FALSE(scene.is_diff);
    ASSERT_EQ(scene.objects.size(), 2U);
    EXPECT_EQ(scene.objects[1].id, "box");
    EXPECT_EQ(scene.objects[0].fault, "");
    const WorldObject all = to_world_object(scene.objects[0], "other");
    EXPECT_EQ(all.name, "all");
    EXPECT_EQ(all.frame, "world");
    ASSERT_EQ(all.geometry.size(), 6U);
    const double z = layout == SceneLayout::kObjectPose ? 10.0 : 0.0;
    EXPECT_EQ(all.X_BO.translation().z(), z);
    const auto distance = [&](double x, double y, double dz) {
      const Solid solid(all.geometry);
      return solid.signed_distance(all.X_BO.inverse() * Eigen::Vector3d(x, y, z + dz)).distance;
    };
    // The plane's half-space is below z = -0.5, and all else is above.
    EXPECT_NEAR(distance(1.0, 0.0, 0.25), 0.1, 1e-9);        // the box
    EXPECT_NEAR(distance(2.0, 0.5, 0.0), 0.1, 1e-9);         // the sphere
    EXPECT_NEAR(distance(3.0, 0.16, 0.0), 0.1, 1e-9);        // the cylinder
    EXPECT_NEAR(distance(0.0, 0.0, 0.35 + 0.1), 0.1, 1e-9);  // the cone: its pose is missing
    EXPECT_NEAR(distance(-0.25, 5.0, 0.0), 0.15, 1e-9);      // the mesh, turned by 90 degrees
    EXPECT_NEAR(distance(20.0, 0.0, -0.4), 0.1, 1e-9);       // the plane
    EXPECT_LT(distance(20.0, 0.0, -0.6), 0.0);
    EXPECT_LT(distance(2.0, 0.0, 0.0), 0.0);
  }
}

// The pose of a shape that is alone becomes the object's, so that MOVE needs the new pose alone.
TEST(PlanningScene, AShapeAloneGivesTheObjectItsPose) {
  const WirePose pose = {1, 2, 3, 0, 0, 0, 1};
  for (const SceneLayout layout : kLayouts) {
    WireScene wire;
    wire.objects = {box_object("unset", pose), box_object("twice", pose)};
    wire.objects[0].frame = "";
    wire.objects[1].pose = {0, 0, 1, 0, 0, 0, 1};
    const PlanningScene scene = read(wire, layout);
    ASSERT_EQ(scene.objects.size(), 2U) << scene.fault;
    const WorldObject unset = to_world_object(scene.objects[0], "default");
    EXPECT_EQ(unset.frame, "default");
    EXPECT_EQ(unset.X_BO.translation(), Eigen::Vector3d(1, 2, 3));
    EXPECT_TRUE(unset.geometry[0].X_LE.matrix().isIdentity(1e-15));
    const WorldObject twice = to_world_object(scene.objects[1], "default");
    const double z = layout == SceneLayout::kObjectPose ? 4.0 : 3.0;
    EXPECT_EQ((twice.X_BO * twice.geometry[0].X_LE).translation(), Eigen::Vector3d(1, 2, z));
  }
}

TEST(PlanningScene, ObjectsMoveAsMoveItMovesThem) {
  const WirePose from = {1, 0, 0, 0, 0, 0, 1}, to = {0, 0, 2, 0, 0, 1, 0};
  for (const SceneLayout layout : kLayouts) {
    WireScene wire;
    wire.objects = {box_object("box", from), every_shape(), every_shape()};
    WireObject& pair = wire.objects[1];
    pair.primitives.resize(2);
    pair.primitive_poses = {{1, 0, 0, 0, 0, 0, 1}, {2, 0, 0, 0, 0, 0, 1}};
    pair.meshes.clear(), pair.mesh_poses.clear(), pair.planes.clear(), pair.plane_poses.clear();
    // Poses alone, as monitors of Melodic send them; Noetic reads them as well.
    WireObject move = box_object("box", to);
    move.operation = 3;
    move.primitives.clear();
    WireObject together = pair, apart = pair, fewer = pair, pose_alone = pair,
               with_plane = every_shape();
    for (WireObject* one : {&together, &apart, &fewer, &pose_alone}) {
      one->operation = 3;
      one->primitives.clear();
    }
    together.primitive_poses = {{1, 0, 5, 0, 0, 0, 1}, {2, 0, 5, 0, 0, 0, 1}};
    apart.primitive_poses = {{1, 0, 5, 0, 0, 0, 1}, {2.1, 0, 5, 0, 0, 0, 1}};
    fewer.primitive_poses.resize(1);
    pose_alone.primitive_poses.clear();
    pose_alone.pose = {0, 7, 0, 0, 0, 0, 1};
    with_plane.operation = 3;
    wire.objects.insert(wire.objects.end(), {move, together, apart, fewer, pose_alone, with_plane});
    const PlanningScene scene = read(wire, layout);
    ASSERT_EQ(scene.objects.size(), 9U) << scene.fault;
    const WorldObject box = to_world_object(scene.objects[0], "");
    const WorldObject two = to_world_object(scene.objects[1], "");
    const WorldObject all = to_world_object(scene.objects[2], "");
    Eigen::Isometry3d X;
    ASSERT_EQ(moved_pose(scene.objects[3], box, &X), "");
    EXPECT_TRUE(X.translation().isApprox(Eigen::Vector3d(0, 0, 2)));
    EXPECT_TRUE((X.linear() * Eigen::Vector3d::UnitX()).isApprox(-Eigen::Vector3d::UnitX()));
    ASSERT_EQ(moved_pose(scene.objects[4], two, &X), "");
    EXPECT_TRUE((X * two.geometry[1].X_LE).translation().isApprox(Eigen::Vector3d(2, 0, 5)));
    EXPECT_NE(moved_pose(scene.objects[5], two, &X).find("against one another"), std::string::npos);
    EXPECT_NE(moved_pose(scene.objects[6], two, &X).find("2 shapes"), std::string::npos);
    const std::string fault = moved_pose(scene.objects[7], two, &X);
    if (layout == SceneLayout::kObjectPose) {
      EXPECT_EQ(fault, "");
      EXPECT_EQ(X.translation(), Eigen::Vector3d(0, 7, 0));
    } else {
      EXPECT_NE(fault.find("no pose"), std::string::npos) << fault;
    }
    EXPECT_NE(moved_pose(scene.objects[8], all, &X).find("ADD"), std::string::npos);
  }
}

TEST(PlanningScene, ShapesAreAppendedWhereBothReadingsAgree) {
  for (const SceneLayout layout : kLayouts) {
    WireScene wire;
    WireObject known = box_object("box", {1, 0, 0, 0, 0, 0, 1});
    WireObject more = box_object("box", {2, 0, 0, 0, 0, 0, 1});
    WireObject same_pose = more;
    WireObject other_frame = more;
    same_pose.pose = {1, 0, 0, 0, 0, 0, 1};
    other_frame.frame = "elsewhere";
    for (WireObject* one : {&more, &same_pose, &other_frame}) one->operation = 2;
    wire.objects = {known, more, same_pose, other_frame};
    const PlanningScene scene = read(wire, layout);
    ASSERT_EQ(scene.objects.size(), 4U) << scene.fault;
    const WorldObject box = to_world_object(scene.objects[0], "");
    WorldObject grown = box;
    const std::string fault = append_shapes(scene.objects[1], "", &grown);
    const auto x_of_second = [&] {
      return (grown.X_BO * grown.geometry.at(1).X_LE).translation().x();
    };
    if (layout == SceneLayout::kShapePoses) {
      EXPECT_EQ(fault, "");
      EXPECT_EQ(x_of_second(), 2.0);
    } else {
      EXPECT_NE(fault.find("another pose"), std::string::npos) << fault;
      EXPECT_EQ(grown.geometry.size(), 1U);
      ASSERT_EQ(append_shapes(scene.objects[2], "", &grown), "");
      EXPECT_EQ(x_of_second(), 3.0);
    }
    EXPECT_NE(append_shapes(scene.objects[3], "", &grown).find("elsewhere"), std::string::npos);
  }
}

TEST(PlanningScene, AttachedObjectsAreReadWithTheirLinks) {
  for (const SceneLayout layout : kLayouts) {
    WireScene wire;
    wire.is_diff = true;
    wire.attached = {box_object("tool", {1, 2, 3, 0, 0, 0, 1}), every_shape(), every_shape()};
    wire.attached[0].frame = "hand";
    wire.attached[2].operation = 1;
    wire.objects = {box_object("box", kIdentityPose)};
    const PlanningScene scene = read(wire, layout);
    ASSERT_EQ(scene.fault, "");
    EXPECT_TRUE(scene.notes.empty());
    ASSERT_EQ(scene.attachments.size(), 3U);
    for (const SceneAttachment& one : scene.attachments) {
      EXPECT_EQ(one.link, "hand");
      EXPECT_EQ(one.touch_links, std::vector<std::string>{"finger"});
      EXPECT_EQ(one.object.fault, "");
    }
    const WorldObject tool = to_world_object(scene.attachments[0].object, "other");
    EXPECT_EQ(tool.name, "tool");
    EXPECT_EQ(tool.frame, "hand");
    EXPECT_EQ(tool.X_BO.translation(), Eigen::Vector3d(1, 2, 3));
    EXPECT_EQ(scene.attachments[1].object.geometry.size(), 6U);
    EXPECT_EQ(scene.attachments[1].object.operation, Operation::kAdd);
    EXPECT_EQ(scene.attachments[2].object.operation, Operation::kRemove);
    ASSERT_EQ(scene.objects.size(), 1U);
    EXPECT_EQ(scene.objects[0].id, "box");
  }
}

// Attached objects take memory, as those of the world do.
TEST(PlanningScene, ShapesOfAttachedObjectsCount) {
  WireScene wire;
  wire.attached = {every_shape()};
  wire.objects = {every_shape()};
  WorldLimits limits;
  limits.max_objects = 12;
  EXPECT_EQ(read(wire, kLayouts[1], limits).fault, "");
  limits.max_objects = 11;
  EXPECT_NE(read(wire, kLayouts[1], limits).fault.find("more shapes"), std::string::npos);
  limits = {};
  limits.max_triangles = 7;  // each has a mesh of 4
  EXPECT_NE(read(wire, kLayouts[1], limits).fault.find("more triangles"), std::string::npos);
}

SceneAttachment attachment(const std::string& id, const std::string& link) {
  SceneAttachment one;
  one.link = link;
  one.touch_links = {"finger"};
  one.object.id = id;
  return one;
}

TEST(AttachedObjects, StayUntilTheyAreDetached) {
  AttachedObjects attached(4);
  EXPECT_EQ(attached.sentence(), "");
  for (const char* id : {"cup", "drill", "saw"}) {
    EXPECT_TRUE(attached.attach(attachment(id, "hand")));
  }
  EXPECT_TRUE(attached.attach(attachment("hat", "head")));
  EXPECT_FALSE(attached.attach(attachment("bag", "hand")));
  EXPECT_TRUE(attached.attach(attachment("saw", "foot")));  // in place of that in the hand
  EXPECT_EQ(attached.names(), (std::vector<std::string>{"cup", "drill", "hat", "saw"}));
  EXPECT_EQ(attached.touched_by("saw"), (std::vector<std::string>{"finger", "foot"}));
  EXPECT_TRUE(attached.touched_by("bag").empty());
  const std::string said = attached.sentence();
  EXPECT_NE(said.find("'cup' (to 'hand'), 'drill' (to 'hand'), 'hat' (to 'head') and 1 more: "),
            std::string::npos)
      << said;
  EXPECT_NE(said.find("not against clouds"), std::string::npos) << said;
  EXPECT_TRUE(attached.detach(attachment("cup", "head")).empty());  // MoveIt refuses it
  EXPECT_TRUE(attached.detach(attachment("bag", "")).empty());
  EXPECT_EQ(attached.detach(attachment("cup", "hand")), std::vector<std::string>{"cup"});
  EXPECT_EQ(attached.detach(attachment("", "head")), std::vector<std::string>{"hat"});
  EXPECT_TRUE(attached.contains("saw"));
  EXPECT_EQ(attached.detach(attachment("", "")), (std::vector<std::string>{"drill", "saw"}));
  EXPECT_EQ(attached.sentence(), "");
}

// A difference that does not name attached objects keeps them. A whole state ends them, as a whole
// scene does.
TEST(PlanningScene, OnlyWholeStatesEndAttachments) {
  WireScene wire;
  EXPECT_FALSE(read(wire).keeps_attached);
  wire.is_diff = true;
  EXPECT_TRUE(read(wire).keeps_attached);
  wire.attached = {box_object("drill", kIdentityPose)};
  EXPECT_TRUE(read(wire).keeps_attached);
  wire.is_state_diff = false;
  EXPECT_FALSE(read(wire).keeps_attached);
}

TEST(PlanningScene, TheOctomapIsReadWithItsPose) {
  for (const SceneLayout layout : kLayouts) {
    WireScene wire;
    wire.octomap = one_leaf(0.5);
    wire.octomap.origin = {1, 2, 3, 0, 0, 1, 0};
    PlanningScene scene = read(wire, layout);
    ASSERT_EQ(scene.fault, "");
    ASSERT_EQ(scene.octomap.fault, "");
    EXPECT_TRUE(scene.sets_octomap);
    EXPECT_EQ(scene.octomap.frame, "map");
    ASSERT_EQ(scene.octomap.tree.occupied.size(), 1U);
    EXPECT_EQ(scene.octomap.tree.occupied[0].min(), Eigen::Vector3d(0, 0, 0));
    EXPECT_EQ(scene.octomap.tree.occupied[0].max(), Eigen::Vector3d(0.5, 0.5, 0.5));
    EXPECT_TRUE(
        (scene.octomap.X_BM * Eigen::Vector3d(0.5, 0, 0)).isApprox(Eigen::Vector3d(0.5, 2, 3)));
    wire.octomap.is_binary = false;  // its bytes are no tree of log-odds
    scene = read(wire, layout);
    EXPECT_EQ(scene.fault, "");
    EXPECT_NE(scene.octomap.fault, "");
  }
}

// A difference changes the octomap where it states one, or says that it is gone; a full scene
// always does.
TEST(PlanningScene, TheOctomapIsReplacedAsInMoveIt) {
  WireScene wire;
  EXPECT_TRUE(read(wire).sets_octomap);
  wire.is_diff = true;
  EXPECT_FALSE(read(wire).sets_octomap);
  WireScene named = wire;
  named.octomap.id = "cleared";
  EXPECT_TRUE(read(named).sets_octomap);
  EXPECT_EQ(read(named).octomap.fault, "");
  EXPECT_TRUE(read(named).octomap.tree.occupied.empty());
  WireScene removed = wire;
  removed.objects = {box_object("<octomap>", kIdentityPose)};
  EXPECT_FALSE(read(removed).sets_octomap);
  removed.objects[0].operation = 1;
  EXPECT_TRUE(read(removed).sets_octomap);
  WireScene stated = wire;
  stated.octomap = one_leaf();
  EXPECT_TRUE(read(stated).sets_octomap);
}

// An octomap that cannot be used is a fault of its own: the scene's objects are there.
TEST(PlanningScene, AnOctomapThatCannotBeUsedIsSaid) {
  struct Bad {
    const char* what;
    void (*spoil)(WireOctomap*);
    const char* said;
  };
  const std::vector<Bad> all = {
      {"another type", [](WireOctomap* o) { o->id = "ColorOcTree"; }, "ColorOcTree"},
      {"a long type", [](WireOctomap* o) { o->id.assign(100000, 'x'); }, "type"},
      {"no resolution", [](WireOctomap* o) { o->resolution = 0.0; }, "resolution"},
      {"a resolution of NaN", [](WireOctomap* o) { o->resolution = kNaN; }, "resolution"},
      {"a huge resolution", [](WireOctomap* o) { o->resolution = 1e300; }, "resolution"},
      {"bytes after the tree", [](WireOctomap* o) { o->data.push_back(0); }, "ends 1 bytes before"},
      {"NaN in the origin", [](WireOctomap* o) { o->origin[1] = kNaN; }, "its origin"},
      {"an origin far away", [](WireOctomap* o) { o->origin[1] = 1e9; }, "its origin"},
      {"a quaternion of length 2", [](WireOctomap* o) { o->origin[6] = 2.0; }, "length 2"},
      {"an origin without frame",
       [](WireOctomap* o) {
         o->frame = "";
         o->origin[0] = 1.0;
       },
       "no frame_id"},
      {"a long frame", [](WireOctomap* o) { o->frame.assign(100000, 'x'); }, "frame_id"}};
  WireScene wire;
  wire.objects = {box_object("box", kIdentityPose)};
  const auto fault = [&](const WireOctomap& octomap) {
    wire.octomap = octomap;
    const PlanningScene scene = read(wire);
    EXPECT_EQ(scene.fault, "");
    EXPECT_EQ(scene.objects.size(), 1U);
    EXPECT_TRUE(scene.sets_octomap);
    EXPECT_TRUE(scene.octomap.fault.empty() || scene.octomap.tree.occupied.empty());
    EXPECT_LT(scene.octomap.fault.size(), 400U);
    return scene.octomap.fault;
  };
  ASSERT_EQ(fault(one_leaf()), "");
  for (const Bad& bad : all) {
    WireOctomap octomap = one_leaf();
    bad.spoil(&octomap);
    EXPECT_NE(fault(octomap).find(bad.said), std::string::npos) << bad.what;
  }
  for (std::size_t size = 1; size < one_leaf().data.size(); ++size) {
    WireOctomap octomap = one_leaf();
    octomap.data.resize(size);
    EXPECT_NE(fault(octomap), "") << size;
  }
  OctreeLimits limits;
  limits.max_leaves = 0;
  wire.octomap = one_leaf();
  const std::vector<std::uint8_t> bytes = wire.bytes(SceneLayout::kObjectPose);
  const PlanningScene scene = read_planning_scene(bytes, SceneLayout::kObjectPose, {}, limits);
  EXPECT_NE(scene.octomap.fault.find("max_leaves"), std::string::npos) << scene.octomap.fault;
}

// Whatever the data is, it is a tree that keeps to the limits or a fault.
TEST(PlanningScene, RandomOctomapsKeepToTheLimits) {
  test::Rng rng(19);
  OctreeLimits limits;
  limits.max_leaves = 50;
  int read_well = 0;
  for (int i = 0; i < 5000; ++i) {
    WireScene wire;
    wire.objects = {box_object("box", kIdentityPose)};
    wire.octomap = one_leaf();
    wire.octomap.is_binary = test::uniform(&rng, 0, 1) < 0.5;
    std::vector<std::uint8_t>& data = wire.octomap.data;
    for (int k = 0; k < 3; ++k) {
      const auto at = static_cast<std::size_t>(test::uniform(&rng, 0, 31.99));
      data[at] = static_cast<std::uint8_t>(test::uniform(&rng, 0, 255.99));
    }
    const std::vector<std::uint8_t> bytes = wire.bytes(SceneLayout::kObjectPose);
    const PlanningScene scene = read_planning_scene(bytes, SceneLayout::kObjectPose, {}, limits);
    ASSERT_EQ(scene.fault, "");
    ASSERT_EQ(scene.objects.size(), 1U);
    ASSERT_LE(scene.octomap.tree.occupied.size(), limits.max_leaves);
    for (const Eigen::AlignedBox3d& leaf : scene.octomap.tree.occupied) {
      ASSERT_GT(leaf.sizes().minCoeff(), 0.0);
      ASSERT_LE(leaf.min().cwiseAbs().cwiseMax(leaf.max().cwiseAbs()).maxCoeff(),
                limits.max_position);
    }
    read_well += scene.octomap.fault.empty() ? 1 : 0;
  }
  EXPECT_GT(read_well, 20);
}

TEST(PlanningScene, AllowedPairsNeedBothEntries) {
  WireScene wire;
  wire.matrix_names = {"base", "table", "wall", "hand"};
  wire.matrix = {{0, 1, 1, 0}, {1, 0, 1, 0}, {0, 1, 0, 0}, {0, 1, 0, 1}};
  PlanningScene scene = read(wire);
  const auto is_object = [](const std::string& name) { return name == "wall" || name == "table"; };
  EXPECT_EQ(scene.allowed.allowed_with("table", is_object), std::vector<std::string>{"base"});
  EXPECT_TRUE(scene.allowed.allowed_with("wall", is_object).empty());
  EXPECT_TRUE(scene.allowed.allowed_with("unknown", is_object).empty());
  for (const bool is_row : {true, false}) {
    WireScene bad = wire;
    if (is_row) bad.matrix.pop_back();
    if (!is_row) bad.matrix[2].push_back(1);
    bad.objects = {box_object("box", kIdentityPose)};
    scene = read(bad);
    EXPECT_EQ(scene.fault, "");
    EXPECT_EQ(scene.objects.size(), 1U);
    EXPECT_TRUE(scene.allowed.names.empty());
    ASSERT_EQ(scene.notes.size(), 1U);
    EXPECT_NE(scene.notes[0].find("not square"), std::string::npos);
  }
  WireScene large;
  large.matrix_names.assign(20001, "x");
  scene = read(large);
  EXPECT_TRUE(scene.allowed.names.empty());
  EXPECT_EQ(scene.notes.size(), 1U);
}

// One object that cannot be used says so, and the others are there.
TEST(PlanningScene, AnObjectThatCannotBeUsedIsNamedAlone) {
  struct Bad {
    const char* what;
    void (*spoil)(WireObject*);
    const char* said;
  };
  const std::vector<Bad> all = {
      {"NaN in the pose", [](WireObject* o) { o->pose[0] = kNaN; }, "its pose"},
      {"a pose far away", [](WireObject* o) { o->pose[1] = 1e9; }, "its pose"},
      {"NaN in the quaternion", [](WireObject* o) { o->pose[3] = kNaN; }, "quaternion"},
      {"infinity in a shape's quaternion", [](WireObject* o) { o->primitive_poses[0][6] = kInf; },
       "quaternion"},
      {"a quaternion of length 2", [](WireObject* o) { o->primitive_poses[0][6] = 2.0; },
       "length 2"},
      {"a size of 0", [](WireObject* o) { o->primitives[0].dimensions[1] = 0.0; }, "dimension"},
      {"a negative size", [](WireObject* o) { o->primitives[1].dimensions[0] = -1.0; },
       "dimension"},
      {"a size of NaN", [](WireObject* o) { o->primitives[2].dimensions[0] = kNaN; }, "dimension"},
      {"a huge size", [](WireObject* o) { o->primitives[3].dimensions[1] = 1e300; }, "dimension"},
      {"too few sizes", [](WireObject* o) { o->primitives[0].dimensions.pop_back(); }, "needed"},
      {"type 0", [](WireObject* o) { o->primitives[0].type = 0; }, "type 0"},
      {"type 5", [](WireObject* o) { o->primitives[0].type = 5; }, "type 5"},
      {"more poses than shapes", [](WireObject* o) { o->mesh_poses.resize(3, kIdentityPose); },
       "3 poses"},
      {"no vertex", [](WireObject* o) { o->meshes[0].vertices.clear(); }, "0 vertices"},
      {"no triangle", [](WireObject* o) { o->meshes[0].triangles.clear(); }, "0 triangles"},
      {"a vertex that is not there", [](WireObject* o) { o->meshes[0].triangles[2][1] = 4; },
       "vertex 4"},
      {"the last vertex number", [](WireObject* o) { o->meshes[0].triangles[2][1] = 0xFFFFFFFFU; },
       "vertex 4294967295"},
      {"a plane without normal",
       [](WireObject* o) {
         o->planes[0] = {0, 0, 0, 1};
       },
       "plane"},
      {"a plane of NaN", [](WireObject* o) { o->planes[0][3] = kNaN; }, "plane"},
      {"operation 4", [](WireObject* o) { o->operation = 4; }, "operation is 4"},
      {"operation 255", [](WireObject* o) { o->operation = 255; }, "operation is 255"}};
  for (const Bad& bad : all) {
    SCOPED_TRACE(bad.what);
    WireScene wire;
    wire.objects = {box_object("before", kIdentityPose), every_shape(),
                    box_object("after", kIdentityPose)};
    wire.objects[1].pose = kIdentityPose;
    bad.spoil(&wire.objects[1]);
    const PlanningScene scene = read(wire);
    ASSERT_EQ(scene.fault, "");
    ASSERT_EQ(scene.objects.size(), 3U);
    EXPECT_EQ(scene.objects[0].fault, "");
    EXPECT_NE(scene.objects[1].fault.find(bad.said), std::string::npos) << scene.objects[1].fault;
    EXPECT_EQ(scene.objects[2].fault, "");
    EXPECT_EQ(scene.objects[2].id, "after");
    WorldBuilder builder;
    EXPECT_TRUE(builder.add({to_world_object(scene.objects[2], "world")}).empty());
  }
}

// Vertices of NaN, coordinates of 1e300 and names that are none are found where the world is built.
TEST(PlanningScene, WhatTheReaderLeavesIsRefusedByTheBuilder) {
  WireScene wire;
  wire.objects = {every_shape(),
                  every_shape(),
                  box_object(std::string(1000, 'x'), kIdentityPose),
                  box_object("", kIdentityPose),
                  box_object("a\nb", kIdentityPose),
                  WireObject{"world", "no shape"}};
  wire.objects[0].meshes[0].vertices[1][2] = kNaN;
  wire.objects[1].meshes[0].vertices[1][2] = 1e300;
  const PlanningScene scene = read(wire);
  ASSERT_EQ(scene.objects.size(), 6U) << scene.fault;
  for (const SceneObject& object : scene.objects) {
    EXPECT_EQ(object.fault, "");
    WorldBuilder builder;
    const std::vector<WorldFault> faults = builder.add({to_world_object(object, "world")});
    ASSERT_EQ(faults.size(), 1U) << object.id;
    EXPECT_LT(faults[0].text.size(), 400U);
    EXPECT_EQ(builder.size(), 0U);
  }
}

TEST(PlanningScene, AQuaternionOfZerosIsTheIdentity) {
  WireScene wire;
  wire.objects = {box_object("box", {1, 2, 3, 0, 0, 0, 0})};
  const PlanningScene scene = read(wire);
  ASSERT_EQ(scene.objects.size(), 1U) << scene.fault;
  EXPECT_EQ(scene.objects[0].fault, "");
  const WorldObject box = to_world_object(scene.objects[0], "");
  EXPECT_EQ(box.X_BO.translation(), Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(box.X_BO.linear(), Eigen::Matrix3d::Identity());
}

// Every prefix of a message is refused with the place where it ends, and so is what follows it.
TEST(PlanningScene, TruncatedMessagesAreRefused) {
  WireScene wire;
  wire.objects = {every_shape()};
  wire.attached = {every_shape()};
  wire.matrix_names = {"a", "b"};
  wire.matrix = {{0, 1}, {1, 0}};
  wire.octomap = one_leaf();
  for (const SceneLayout layout : kLayouts) {
    const std::vector<std::uint8_t> whole = wire.bytes(layout);
    EXPECT_EQ(read_planning_scene(whole, layout).fault, "");
    for (std::size_t size = 0; size < whole.size(); ++size) {
      const std::vector<std::uint8_t> part(whole.begin(),
                                           whole.begin() + static_cast<std::ptrdiff_t>(size));
      const PlanningScene scene = read_planning_scene(part, layout);
      ASSERT_NE(scene.fault, "") << size;
      ASSERT_TRUE(scene.objects.empty());
    }
    std::vector<std::uint8_t> longer = whole;
    longer.push_back(0);
    EXPECT_NE(read_planning_scene(longer, layout).fault.find("1 bytes follow"), std::string::npos);
    const SceneLayout other =
        layout == SceneLayout::kObjectPose ? SceneLayout::kShapePoses : SceneLayout::kObjectPose;
    EXPECT_NE(read_planning_scene(whole, other).fault, "");
  }
}

// Counts of 4 thousand million must take neither memory nor time: each byte that may be one of a
// count is set to 255.
TEST(PlanningScene, HugeCountsAndRandomBytesAreRefusedAtOnce) {
  WireScene wire;
  wire.objects = {every_shape(), box_object("box", kIdentityPose)};
  wire.attached = {every_shape()};
  wire.matrix_names = {"a", "b"};
  wire.matrix = {{0, 1}, {1, 0}};
  test::Rng rng(11);
  int refused = 0, cases = 0;
  for (const SceneLayout layout : kLayouts) {
    const std::vector<std::uint8_t> whole = wire.bytes(layout);
    for (std::size_t at = 0; at < whole.size(); ++at) {
      std::vector<std::uint8_t> bytes = whole;
      bytes[at] = 255;
      if (at + 3 < whole.size() && at % 2 == 0) bytes[at + 1] = bytes[at + 2] = bytes[at + 3] = 255;
      const PlanningScene scene = read_planning_scene(bytes, layout);
      ASSERT_TRUE(scene.fault.empty() || scene.objects.empty());
      refused += scene.fault.empty() ? 0 : 1;
      ++cases;
    }
    for (int i = 0; i < 2000; ++i) {
      std::vector<std::uint8_t> bytes(static_cast<std::size_t>(test::uniform(&rng, 0, 400)));
      for (std::uint8_t& byte : bytes) {
        byte = test::uniform(&rng, 0, 1) < 0.7
                   ? 0
                   : static_cast<std::uint8_t>(test::uniform(&rng, 0, 255.99));
      }
      const PlanningScene scene = read_planning_scene(bytes, layout);
      ASSERT_TRUE(scene.fault.empty() || scene.objects.empty());
    }
  }
  EXPECT_GT(refused, cases / 8);
}

// The counts are compared with the limits before anything is kept.
TEST(PlanningScene, ASceneAboveTheLimitsIsRefusedWhole) {
  WorldLimits limits;
  limits.max_objects = 50;
  limits.max_triangles = 11;
  WireScene objects, shapes, triangles;
  for (int i = 0; i < 51; ++i) {
    objects.objects.push_back(box_object("box " + std::to_string(i), kIdentityPose));
  }
  shapes.objects = {box_object("many", kIdentityPose)};
  shapes.objects[0].primitives.resize(51, shapes.objects[0].primitives[0]);
  triangles.objects = {every_shape(), every_shape(), every_shape()};
  WireScene attached;
  attached.attached = objects.objects;
  EXPECT_NE(
      read(attached, kLayouts[1], limits).fault.find("it attaches 51 objects; allowed are 50"),
      std::string::npos);
  const std::string texts[] = {read(objects, kLayouts[1], limits).fault,
                               read(shapes, kLayouts[1], limits).fault,
                               read(triangles, kLayouts[1], limits).fault};
  EXPECT_NE(texts[0].find("51 objects; allowed are 50 (max_objects)"), std::string::npos);
  EXPECT_NE(texts[1].find("max_objects"), std::string::npos) << texts[1];
  EXPECT_NE(texts[2].find("max_triangles"), std::string::npos) << texts[2];
  WireScene hundred_thousand;
  hundred_thousand.objects.assign(100000, box_object("box", kIdentityPose));
  const PlanningScene scene = read(hundred_thousand);
  EXPECT_NE(scene.fault.find("100000 objects; allowed are 10000"), std::string::npos)
      << scene.fault;
  EXPECT_TRUE(scene.objects.empty());
}

}  // namespace
}  // namespace ist
