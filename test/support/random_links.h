#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "ist_proximity/robot/robot_model.h"
#include "support/scene.h"

/// Small links of every kind, for many cases against an oracle that tries every triangle.
namespace ist::test {

/// A sphere with a random surface, star-shaped.
TriangleMesh random_lump(Rng* rng);

/// Random triangles: mostly open, crossing each other, of any orientation.
TriangleMesh random_soup(Rng* rng, int count);

LinkGeometry one(const Shape& shape);

LinkGeometry random_compound(Rng* rng);

/// Primitives, closed, concave, thin, crossing, compound, and meshes with holes.
std::vector<LinkGeometry> random_links(Rng* rng);

std::shared_ptr<const RobotModel> model_of(const std::vector<LinkGeometry>& links,
                                           double max_error);

/// Points about a link: in a volume, a plane, a line, a cluster, or next to its own surface.
std::vector<Eigen::Vector3d> random_points(Rng* rng, const LinkGeometry& link, int count);

}  // namespace ist::test
