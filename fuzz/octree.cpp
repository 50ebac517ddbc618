// OctoMap trees, as messages and as files: leaves are cubes on the tree's grid, apart from each
// other, and as many as the data can hold.
// Covers: src/cloud/maps/octree.cpp

#include <Eigen/Geometry>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "ist_proximity/cloud/octree.h"
#include "support/byte_reader.h"
#include "support/check.h"
#include "support/input_file.h"

namespace {

using ist::fuzz::ByteReader;

constexpr double kHalf = 32768.0;  // smallest leaves from the middle to a side
constexpr std::size_t kFew = 300;  // leaves that are compared with each other

// Everything that holds for a tree that was read.
void check(const ist::Octree& octree, double resolution, std::size_t bytes) {
  // A node of a binary tree says eight leaves in two bytes.
  FUZZ_CHECK(octree.nodes <= 1 + 4 * bytes, "%zu nodes in %zu bytes", octree.nodes, bytes);
  FUZZ_CHECK(octree.occupied.size() + octree.free <= octree.nodes, "%zu + %zu leaves, %zu nodes",
             octree.occupied.size(), octree.free, octree.nodes);
  for (std::size_t i = 0; i < octree.occupied.size(); ++i) {
    const Eigen::AlignedBox3d& box = octree.occupied[i];
    const Eigen::Array3d low = box.min().array() / resolution,
                         size = box.sizes().array() / resolution;
    FUZZ_CHECK((low >= -kHalf - 0.01).all() && (low + size <= kHalf + 0.01).all(),
               "leaf %zu is outside of the tree", i);
    FUZZ_CHECK((low - low.round()).abs().maxCoeff() < 0.01 && size.minCoeff() > 0.99,
               "leaf %zu is off the grid", i);
    for (std::size_t k = 0; k < i && i < kFew; ++k) {
      const double shared = (box.max().cwiseMin(octree.occupied[k].max()) -
                             box.min().cwiseMax(octree.occupied[k].min()))
                                .minCoeff();
      FUZZ_CHECK(shared < 0.5 * resolution, "leaves %zu and %zu overlap", k, i);
    }
  }
}

}  // namespace

// Byte 0: bit 0 a message or a file; for messages bit 1 says the kind of tree, and resolution and
// type follow. The rest is the data.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  ByteReader in(data, size);
  const std::uint8_t kind = in.byte();
  ist::Octree octree;
  std::string fault;
  if ((kind & 1U) != 0) {
    static ist::fuzz::InputFile file(".bt");
    file.write(in.rest(), in.left());
    fault = ist::read_octree_file(file.path(), &octree);
    FUZZ_CHECK(octree.occupied.size() <= 4 * size, "%zu leaves in %zu bytes",
               octree.occupied.size(), size);
  } else {
    ist::OctreeData message;
    message.is_binary = (kind & 2U) != 0;
    message.id = (kind & 0xF0U) == 0xF0U ? in.text(12) : "OcTree";
    message.resolution = in.number(1.0);
    message.data = in.rest();
    message.size = in.left();
    fault = ist::read_octree(message, &octree);
    if (fault.empty()) check(octree, message.resolution, message.size);
  }
  FUZZ_CHECK(fault.empty() || fault.back() == '.', "no sentence: %s", fault.c_str());
  return 0;
}
