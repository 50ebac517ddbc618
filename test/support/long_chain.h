#pragma once

#include <string>

namespace ist::test {

/// The URDF of a chain of links: meshes of the demo, boxes and cylinders in turn, each of another
/// size, so that each is packed by itself.
std::string long_chain_urdf(int links);

}  // namespace ist::test
