#pragma once

#include <map>
#include <string>
#include <vector>

#include "pack_robot/containing_spheres.h"
#include "pack_robot/input.h"

namespace ist::tools {

/// Spheres by the name of their link.
using LinkSpheres = std::map<std::string, std::vector<LinkSphere>>;

/// The robot's URDF with spheres as the collision geometry of the links that have some; the rest of
/// it stays as it is. A mesh becomes a robot of one link.
std::string spheres_as_urdf(const Input& input, const LinkSpheres& spheres);

/// A list of {center, radius} for each link, in YAML.
std::string spheres_as_yaml(const LinkSpheres& spheres);

/// The robot file of cuRobo (robot_cfg) with these spheres. Pairs of links that one joint connects,
/// over links without geometry too, are in self_collision_ignore. What a URDF does not tell stands
/// as cuRobo's own robots have it: weights of 1, max_acceleration 15, max_jerk 500.
std::string spheres_as_curobo(const Input& input, const LinkSpheres& spheres);

}  // namespace ist::tools
