#pragma once

#include <string>

#include "ist_proximity/geometry/shapes.h"

/// The content of mesh files, for tests that write their own.
namespace ist::test {

std::string ascii_stl(const TriangleMesh& mesh);

/// @param header  up to 80 characters; some programs begin it with "solid" as if it were ASCII
std::string binary_stl(const TriangleMesh& mesh, std::string header = "binary");

std::string obj(const TriangleMesh& mesh);

/// The parts of a Collada file around its mesh.
struct ColladaOptions {
  std::string unit = "<unit name=\"meter\" meter=\"1\"/>";
  std::string up_axis = "Z_UP";
  std::string transform;   ///< in the node: <matrix>, <scale>, <translate>, <rotate>
  bool with_line = false;  ///< a line primitive among the triangles
};

std::string collada(const TriangleMesh& mesh, const ColladaOptions& options = {});

}  // namespace ist::test
