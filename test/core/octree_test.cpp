// The reader of OctoMap trees, against liboctomap.

#include "ist_proximity/cloud/octree.h"

#include <gtest/gtest.h>
#include <octomap/octomap.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "ist_proximity/octomap.h"
#include "support/accuracy.h"
#include "support/errors.h"
#include "support/sanitizers.h"
#include "support/scene.h"
#include "support/temp_dir.h"

namespace ist {
namespace {

using test::expect_says;
using Leaf = std::array<double, 4>;  // [m] its middle and size

// Scattered leaves, a solid block (whose leaves merge into large ones), free space.
octomap::OcTree random_tree(test::Rng* rng, double resolution, int points) {
  octomap::OcTree tree(resolution);
  for (int i = 0; i < points; ++i) {
    const Eigen::Vector3d p = test::random_vector(rng, 40.0 * resolution);
    tree.updateNode(p.x(), p.y(), p.z(), test::uniform(rng, 0, 1) < 0.6);
  }
  if (points > 0) {
    for (int i = 0; i < 16 * 16 * 16; ++i) {
      const auto at = [&](int k) { return (k % 16 + 0.5) * resolution; };
      tree.updateNode(at(i), at(i / 16), at(i / 256), true);
    }
  }
  tree.updateInnerOccupancy();
  return tree;
}

std::vector<Leaf> leaves_of(const octomap::OcTree& tree) {
  std::vector<Leaf> leaves;
  for (auto leaf = tree.begin_leafs(); leaf != tree.end_leafs(); ++leaf) {
    if (tree.isNodeOccupied(*leaf)) {
      leaves.push_back({leaf.getX(), leaf.getY(), leaf.getZ(), leaf.getSize()});
    }
  }
  std::sort(leaves.begin(), leaves.end());
  return leaves;
}

void expect_same(const Octree& octree, const octomap::OcTree& tree) {
  std::vector<Leaf> found;
  for (const Eigen::AlignedBox3d& box : octree.occupied) {
    // The rounding of octomap, which computes in float.
    const Eigen::Vector3d c = box.center().cast<float>().cast<double>();
    found.push_back({c.x(), c.y(), c.z(), box.sizes().x()});
  }
  std::sort(found.begin(), found.end());
  const std::vector<Leaf> truth = leaves_of(tree);
  ASSERT_EQ(found.size(), truth.size());
  for (std::size_t i = 0; i < truth.size(); ++i) {
    for (std::size_t k = 0; k < 4; ++k) {
      ASSERT_NEAR(found[i][k], truth[i][k], k < 3 ? 1e-6 : 1e-9);
    }
  }
  // The tree itself is the same obstacles, in the same order, to the bit.
  const std::vector<Eigen::AlignedBox3d> boxes = occupied_boxes(tree);
  ASSERT_EQ(boxes.size(), octree.occupied.size());
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    ASSERT_EQ(boxes[i].min(), octree.occupied[i].min());
    ASSERT_EQ(boxes[i].max(), octree.occupied[i].max());
  }
}

std::string bytes_of(const octomap::OcTree& tree, bool is_binary) {
  std::ostringstream out;
  if (tree.size() > 0) is_binary ? tree.writeBinaryData(out) : tree.writeData(out);
  return out.str();
}

std::string read(const std::string& bytes, bool is_binary, Octree* octree,
                 const std::string& id = "OcTree", double resolution = 0.05,
                 const OctreeLimits& limits = {}) {
  OctreeData data;
  data.id = id;
  data.is_binary = is_binary;
  data.resolution = resolution;
  data.data = reinterpret_cast<const std::uint8_t*>(bytes.data());
  data.size = bytes.size();
  return read_octree(data, octree, limits);
}

TEST(ReadOctree, LeavesOfEverySize) {
  test::Rng rng(51);
  for (int trial = 0; trial < test::scaled(40); ++trial) {
    const double resolution = trial % 2 == 0 ? 0.05 : 0.013;
    octomap::OcTree tree = random_tree(&rng, resolution, trial * 20);
    if (trial % 4 == 1) tree.prune();
    Octree octree;
    ASSERT_EQ(read(bytes_of(tree, false), false, &octree, "OcTree", resolution), "");
    expect_same(octree, tree);
    EXPECT_EQ(octree.nodes, tree.size());
    tree.toMaxLikelihood();
    tree.prune();
    ASSERT_EQ(read(bytes_of(tree, true), true, &octree, "OcTree", resolution), "");
    expect_same(octree, tree);
    EXPECT_EQ(octree.nodes, tree.size());
  }
}

TEST(ReadOctree, Files) {
  test::Rng rng(52);
  const test::TempDir folder;
  octomap::OcTree tree = random_tree(&rng, 0.05, 300);
  const std::string full = folder.file("map.ot");
  const std::string binary = folder.file("map.bt");
  ASSERT_TRUE(tree.write(full));
  Octree octree;
  EXPECT_EQ(read_octree_file(full, &octree), "");
  expect_same(octree, tree);
  ASSERT_TRUE(tree.writeBinary(binary));  // merges leaves of the tree first
  EXPECT_EQ(read_octree_file(binary, &octree), "");
  expect_same(octree, tree);
  const octomap::OcTree empty(0.1);
  ASSERT_TRUE(empty.write(full));
  EXPECT_EQ(read_octree_file(full, &octree), "");
  EXPECT_TRUE(octree.occupied.empty());
}

TEST(ReadOctree, RefusesOtherMessagesWithAReason) {
  test::Rng rng(53);
  const octomap::OcTree tree = random_tree(&rng, 0.05, 100);
  const std::string full = bytes_of(tree, false), binary = bytes_of(tree, true);
  Octree octree;
  expect_says(read(full, false, &octree, "ColorOcTree"), "'ColorOcTree', it must be 'OcTree'");
  expect_says(read(full, false, &octree, "OcTree", 0.0), "resolution is 0");
  expect_says(read(full, false, &octree, "OcTree", std::nan("")), "resolution is nan");
  expect_says(read(full, false, &octree, "OcTree", -0.1), "resolution is -0.1");
  expect_says(read(full + "x", false, &octree), "ends 1 bytes before");
  expect_says(read(binary + "xyz", true, &octree), "ends 3 bytes before");
  expect_says(read(std::string(100, '\xff'), true, &octree), "deeper than 16 levels");
  expect_says(read(std::string(100, '\xff'), false, &octree), "not finite");
  EXPECT_EQ(read("", true, &octree), "");
  EXPECT_TRUE(octree.occupied.empty());
}

// A truncated tree is refused at every length.
TEST(ReadOctree, RefusesEveryTruncation) {
  test::Rng rng(54);
  octomap::OcTree tree(0.05);
  for (int i = 0; i < 20; ++i) {
    const Eigen::Vector3d p = test::random_vector(&rng, 1.0);
    tree.updateNode(p.x(), p.y(), p.z(), true);
  }
  const test::TempDir folder;
  for (const bool is_binary : {false, true}) {
    const std::string bytes = bytes_of(tree, is_binary);
    Octree octree;
    for (std::size_t n = 1; n < bytes.size(); ++n) {
      ASSERT_NE(read(bytes.substr(0, n), is_binary, &octree), "") << n;
    }
    const std::string path = folder.file("cut");
    ASSERT_TRUE(is_binary ? tree.writeBinary(path) : tree.write(path));
    const std::string whole = test::read_text(path);
    for (std::size_t n = 0; n < whole.size(); n += 7) {
      std::ofstream(path, std::ios::binary) << whole.substr(0, n);
      ASSERT_NE(read_octree_file(path, &octree), "") << n;
    }
  }
  Octree octree;
  EXPECT_NE(read_octree_file(folder.file("missing.bt"), &octree), "");
  EXPECT_NE(read_octree_file(folder.path().string(), &octree), "");
}

// Reading random bytes ends, and any leaves that it returns are boxes of the map.
TEST(ReadOctree, RandomBytes) {
  test::Rng rng(55);
  const octomap::OcTree tree = random_tree(&rng, 0.05, 60);
  const std::string binary = bytes_of(tree, true), full = bytes_of(tree, false);
  int readable = 0;
  for (int trial = 0; trial < test::scaled(20000); ++trial) {
    const bool is_binary = trial % 2 == 0;
    std::string bytes;
    if (trial % 3 == 0) {
      bytes.resize(static_cast<std::size_t>(test::uniform(&rng, 0, 200)));
      for (char& byte : bytes) byte = static_cast<char>(rng());
    } else {
      bytes = is_binary ? binary : full;
      for (int flips = 0; flips < 1 + trial % 5; ++flips) {
        bytes[rng() % bytes.size()] ^= static_cast<char>(1U << rng() % 8);
      }
      if (trial % 4 == 0) bytes.resize(rng() % bytes.size());
    }
    Octree octree;
    if (!read(bytes, is_binary, &octree).empty()) continue;
    ++readable;
    for (const Eigen::AlignedBox3d& box : octree.occupied) {
      ASSERT_FALSE(box.isEmpty());
      ASSERT_LE(box.min().cwiseAbs().maxCoeff(), 0.05 * 32768);
      ASSERT_GE(box.sizes().minCoeff(), 0.05 * 0.999);
    }
  }
  EXPECT_GT(readable, 0);
}

// Two bytes of a binary tree can be eight leaves: a message of 2.3 MB made 8 million of them, which
// took 1.2 GB. The reader stops at the limit.
TEST(ReadOctree, StopsAtTheLargestNumberOfLeaves) {
  std::string bytes;
  for (int depth = 0; depth < 10; ++depth) bytes += std::string("\x03\x00", 2);  // one child
  std::string dense = "\xaa\xaa";  // eight occupied leaves
  for (int level = 0; level < 5; ++level) {
    std::string whole = "\xff\xff";  // eight inner nodes
    for (int i = 0; i < 8; ++i) whole += dense;
    dense = whole;
  }
  bytes += dense;
  Octree octree;
  ASSERT_EQ(read(bytes, true, &octree), "");
  const std::size_t leaves = 262144;  // 8^6
  EXPECT_EQ(octree.occupied.size(), leaves);
  OctreeLimits limits;
  limits.max_leaves = leaves;
  EXPECT_EQ(read(bytes, true, &octree, "OcTree", 0.05, limits), "");
  limits.max_leaves = leaves - 1;
  expect_says(read(bytes, true, &octree, "OcTree", 0.05, limits), "262143 (max_leaves)");
  EXPECT_LE(octree.occupied.size(), limits.max_leaves);
  limits = {};
  limits.max_bytes = bytes.size() - 1;
  expect_says(read(bytes, true, &octree, "OcTree", 0.05, limits),
              std::to_string(bytes.size()) + " bytes, allowed are at most");
}

// With a resolution of 0.4 m the tree's space reaches 13 km from its middle, with 1000 m 33,000 km.
TEST(ReadOctree, RefusesLeavesFarOut) {
  const std::string root_corner = std::string("\x02\x00", 2);  // one leaf: an eighth of the space
  Octree octree;
  EXPECT_EQ(read(root_corner, true, &octree, "OcTree", 0.3), "") << "9830.4 m";
  EXPECT_EQ(octree.occupied.size(), 1U);
  for (const double resolution : {0.4, 1000.0}) {
    const std::string fault = read(root_corner, true, &octree, "OcTree", resolution);
    expect_says(fault, "farther out than 10000 m (max_position)");
    expect_says(fault, resolution < 1 ? "-13107.2" : "-3.2768e+07");
  }
  for (const double resolution : {1e-300, 1e300}) {
    expect_says(read(root_corner, true, &octree, "OcTree", resolution), "resolution is 1e");
  }
  // A small leaf in the middle of the same space is near enough.
  std::string chain;
  for (int depth = 0; depth < 15; ++depth) {
    chain += depth == 0 ? std::string("\x00\xc0", 2) : std::string("\x03\x00", 2);
  }
  EXPECT_EQ(read(chain + std::string("\x02\x00", 2), true, &octree, "OcTree", 1000.0), "");
}

// A FIFO without a writer would block for ever when it is opened, and /dev/zero never ends.
TEST(ReadOctree, ReadsOnlyRegularFilesOfLimitedSize) {
  const test::TempDir folder;
  const std::string fifo = folder.file("fifo.bt");
  ASSERT_EQ(mkfifo(fifo.c_str(), 0600), 0);
  Octree octree;
  for (const std::string& path : {fifo, std::string("/dev/zero"), folder.path().string()}) {
    const std::string fault = read_octree_file(path, &octree);
    expect_says(fault, "'" + path + "'");
    expect_says(fault, path == folder.path() ? "is a directory" : "no regular file");
  }
  test::Rng rng(56);
  const std::string path = folder.file("map.ot");
  ASSERT_TRUE(random_tree(&rng, 0.05, 50).write(path));
  const auto size = static_cast<std::size_t>(std::filesystem::file_size(path));
  OctreeLimits limits;
  limits.max_bytes = size;
  EXPECT_EQ(read_octree_file(path, &octree, limits), "");
  limits.max_bytes = size - 1;
  expect_says(read_octree_file(path, &octree, limits),
              std::to_string(size) + " bytes; allowed are at most " + std::to_string(size - 1));
  // A sparse file of a terabyte is refused before it is read.
  std::filesystem::resize_file(path, std::uintmax_t{1} << 40U);
  expect_says(read_octree_file(path, &octree), "1099511627776 bytes");
}

}  // namespace
}  // namespace ist
