#pragma once

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "ist_proximity/proximity/known_world.h"

/// Known worlds of a test's objects.
namespace ist::test {

inline WorldObject object_of(const std::string& name, const LinkGeometry& geometry,
                             const Eigen::Isometry3d& X_BO = Eigen::Isometry3d::Identity()) {
  WorldObject object;
  object.name = name;
  object.frame = "world";
  object.geometry = geometry;
  object.X_BO = X_BO;
  return object;
}

/// None of the objects may be refused. @param X_FB  of all their frames
inline PosedWorld posed(const std::vector<WorldObject>& objects,
                        const Eigen::Isometry3d& X_FB = Eigen::Isometry3d::Identity()) {
  WorldBuilder builder;
  for (const WorldFault& fault : builder.add(objects)) ADD_FAILURE() << fault.text;
  PosedWorld world;
  world.world = builder.world();
  world.X_FB.assign(world.world->frames().size(), X_FB);
  return world;
}

}  // namespace ist::test
