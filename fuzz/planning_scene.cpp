// Planning scenes: what is read keeps to the limits, and each object of it is in the world or there
// is a fault that names it.
// Covers: src/proximity/planning_scene.cpp src/proximity/planning_scene_fields.cpp
// Covers: src/proximity/planning_scene_objects.cpp

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "internal/proximity/planning_scene.h"
#include "ist_proximity/proximity/known_world.h"
#include "support/check.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  ist::WorldLimits limits;
  limits.max_objects = 20;
  limits.max_triangles = 600;  // a cone has 256
  const auto layout =
      data[0] % 2 == 0 ? ist::SceneLayout::kShapePoses : ist::SceneLayout::kObjectPose;
  ist::OctreeLimits octomap;
  octomap.max_leaves = 100;
  const ist::PlanningScene scene =
      ist::read_planning_scene({data + 1, size - 1}, layout, limits, octomap);
  FUZZ_CHECK(scene.fault.empty() || scene.objects.empty(), "a fault, and objects: %s",
             scene.fault.c_str());
  FUZZ_CHECK(scene.objects.size() <= limits.max_objects, "%zu objects", scene.objects.size());
  ist::AttachedObjects attached(limits.max_objects / 2);
  std::vector<ist::SceneObject> objects = scene.objects;
  for (const ist::SceneAttachment& attachment : scene.attachments) {
    attached.attach(attachment);
    objects.push_back(attachment.object);
  }
  const std::size_t count = attached.names().size();
  FUZZ_CHECK(count <= limits.max_objects / 2, "%zu attached", count);
  FUZZ_CHECK(attached.sentence().empty() == (count == 0), "a sentence of %zu attached", count);
  for (const ist::SceneAttachment& attachment : scene.attachments) attached.detach(attachment);
  FUZZ_CHECK(scene.fault.empty() || scene.attachments.empty(), "a fault, and attachments: %s",
             scene.fault.c_str());
  const std::vector<Eigen::AlignedBox3d>& leaves = scene.octomap.tree.occupied;
  FUZZ_CHECK(leaves.size() <= octomap.max_leaves, "%zu leaves", leaves.size());
  FUZZ_CHECK(leaves.empty() || (scene.fault.empty() && scene.octomap.fault.empty()),
             "a fault, and %zu leaves", leaves.size());
  FUZZ_CHECK(leaves.empty() || scene.sets_octomap, "%zu leaves that are not used", leaves.size());
  FUZZ_CHECK(scene.octomap.X_BM.matrix().allFinite(), "an origin that is not finite, %zu leaves",
             leaves.size());
  for (const ist::SceneObject& object : objects) {
    if (!object.fault.empty()) continue;
    const ist::WorldObject added = ist::to_world_object(object, "world");
    ist::WorldBuilder builder(limits);
    const std::vector<ist::WorldFault> faults = builder.add({added});
    FUZZ_CHECK(faults.size() + builder.size() == 1, "%zu faults, %zu objects", faults.size(),
               builder.size());
    if (builder.size() == 0) continue;
    Eigen::Isometry3d X;
    ist::moved_pose(object, added, &X);
    ist::WorldObject more = added;
    ist::append_shapes(object, "world", &more);
  }
  return 0;
}
