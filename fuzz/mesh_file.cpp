// Mesh files: byte 0 chooses the format, the rest is the file. What is read is a mesh: its indices
// name vertices, its coordinates are finite, and its exact distance is that of its triangles.
// Covers: src/geometry/mesh_io.cpp src/geometry/orientation.cpp

#include <Eigen/Core>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>

#include "internal/geometry/mesh_io.h"
#include "ist_proximity/geometry/error.h"
#include "ist_proximity/geometry/solid.h"
#include "support/byte_reader.h"
#include "support/check.h"
#include "support/input_file.h"
#include "support/oracle.h"

namespace {

constexpr std::size_t kFewTriangles = 100;

void check_mesh(const ist::TriangleMesh& mesh) {
  FUZZ_CHECK(!mesh.triangles.empty(), "no triangle");
  for (const ist::TriangleMesh::Triangle& triangle : mesh.triangles) {
    for (const std::uint32_t vertex : triangle) {
      FUZZ_CHECK(vertex < mesh.vertices.size(), "vertex %u of %zu", vertex, mesh.vertices.size());
    }
  }
  for (const Eigen::Vector3d& p : mesh.vertices) FUZZ_CHECK(p.allFinite(), "vertex is not finite");
}

// Distances from points about the mesh; sizes as links have them, since the truth is in double.
void check_distances(const ist::TriangleMesh& mesh) {
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& p : mesh.vertices) box.extend(p);
  const double size = box.diagonal().norm();
  if (!(size > 1e-4 && size < 1e3 && box.center().norm() < 1e3)) return;
  const ist::Solid solid(ist::LinkGeometry{{mesh, Eigen::Isometry3d::Identity(), "fuzz"}});
  for (const Eigen::Vector3d& at : {Eigen::Vector3d(0.1, 0.2, 0.3), Eigen::Vector3d(0.5, 0.4, 0.6),
                                    Eigen::Vector3d(1.4, 0.3, -0.2)}) {
    const Eigen::Vector3d p = box.min() + at.cwiseProduct(box.sizes()) + 0.01 * size * at;
    const double found = solid.signed_distance(p).distance;
    const double truth = ist::test::oracle_distance(mesh, p);
    FUZZ_CHECK(std::abs(std::abs(found) - truth) <= 1e-7 * size,
               "distance %.9g, truth %.9g, size %g", found, truth, size);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const ist::fuzz::InputFile kFiles[] = {
      ist::fuzz::InputFile(".stl"), ist::fuzz::InputFile(".obj"), ist::fuzz::InputFile(".dae")};
  ist::fuzz::ByteReader in(data, size);
  const ist::fuzz::InputFile& file = kFiles[in.below(3)];
  file.write(in.rest(), in.left());
  try {
    const ist::TriangleMesh mesh = ist::load_mesh(file.path());
    check_mesh(mesh);
    if (mesh.triangles.size() <= kFewTriangles) check_distances(mesh);
  } catch (const ist::ModelError& error) {
    FUZZ_CHECK(std::string(error.what()).find(file.path()) != std::string::npos,
               "no file named: %s", error.what());
  }
  return 0;
}
