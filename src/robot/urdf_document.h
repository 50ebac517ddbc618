#pragma once

#include <tinyxml2.h>

#include <string>

namespace ist {

/// The <robot> element of a URDF, checked for what urdfdom does not report: what is no URDF or was
/// not processed by xacro, joints that form no tree, names that cannot be used, and numbers of
/// links and joints beyond the limits.
/// @param document  receives the XML, and outlives the element
/// @throws ModelError
const tinyxml2::XMLElement& robot_element(const std::string& urdf_xml,
                                          tinyxml2::XMLDocument* document);

}  // namespace ist
