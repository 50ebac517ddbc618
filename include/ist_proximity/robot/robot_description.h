#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "ist_proximity/geometry/shapes.h"
#include "ist_proximity/robot/joint_description.h"
#include "ist_proximity/robot/package_resolver.h"

namespace ist {

enum class GeometrySource { kCollision, kVisual };

/// A link of the URDF with the exact shapes it is made of.
struct LinkDescription {
  std::string name;
  LinkGeometry geometry;     ///< empty when `error` is set
  std::string error;         ///< why the geometry cannot be had: element, file, value, what to do
  std::size_t attached = 0;  ///< how many elements, at the end of `geometry`, are attached objects
  bool used_visual_fallback = false;  ///< collision was asked for and only visual is there
};

/// What the node needs of a URDF: names and shapes, in the order of the document.
struct RobotDescription {
  std::string name;
  std::string root_link;
  std::vector<LinkDescription> links;  ///< links that have geometry
  std::vector<std::string> links_without_geometry;
  std::vector<std::string> link_order;  ///< every link, with geometry or without
  std::vector<JointDescription> joints;
};

/// Reads a URDF (urdfdom) and the meshes it names (assimp).
///
/// A link whose geometry is faulty stays in `links` with its `error`; the others go on.
/// @throws ModelError when the text is no URDF: empty, not XML, no <robot>, no link, joints that
///         form no tree.
RobotDescription parse_urdf(const std::string& urdf_xml, GeometrySource source,
                            const PackageFinder& find_package);

}  // namespace ist
