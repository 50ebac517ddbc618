#include "cloud/memory/memory_file.h"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <sstream>
#include <unordered_set>

namespace ist {
namespace {

constexpr double kSameResolution = 2e-6;  // ratio; octomap writes six digits

// Number of blocks that hold a file's leaves; more than `most`: at least so many.
std::size_t count_blocks(const Octree& octree, const VoxelScale& scale, std::size_t most) {
  std::unordered_set<std::uint64_t> blocks;
  for (const VoxelBoxes* leaves : {&octree.occupied, &octree.free_leaves}) {
    for (const Eigen::AlignedBox3d& leaf : *leaves) {
      const KeyBox box = keys_of(leaf, scale);
      for (std::int32_t z = box.low.z; z < box.high.z; z += kBlockSide) {
        for (std::int32_t y = box.low.y; y < box.high.y; y += kBlockSide) {
          for (std::int32_t x = box.low.x; x < box.high.x; x += kBlockSide) {
            blocks.insert(block_id({x, y, z}));
            if (blocks.size() > most) return blocks.size();
          }
        }
      }
    }
  }
  return blocks.size();
}

}  // namespace

KeyBox keys_of(const Eigen::AlignedBox3d& leaf, const VoxelScale& scale) {
  const auto key = [&](double coordinate) {
    return static_cast<std::int32_t>(std::lround(coordinate / scale.resolution())) + kKeyOrigin;
  };
  return {{key(leaf.min().x()), key(leaf.min().y()), key(leaf.min().z())},
          {key(leaf.max().x()), key(leaf.max().y()), key(leaf.max().z())}};
}

std::string write_memory_file(const std::string& path, double resolution, std::size_t nodes,
                              const std::vector<std::uint8_t>& bytes) {
  const std::string part = path + ".part";
  const auto fault = [&] {
    return "the memory cannot be written to '" + path + "': " + std::strerror(errno) + ".";
  };
  errno = 0;
  std::ofstream file(part, std::ios::binary | std::ios::trunc);
  if (!file) return fault();
  file << "# Octomap OcTree binary file\n# Remembered by ist_proximity.\nid OcTree\nsize " << nodes
       << "\nres ";
  file.precision(17);
  file << resolution << "\ndata\n";
  file.write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
  file.close();
  if (!file || std::rename(part.c_str(), path.c_str()) != 0) {
    std::string text = fault();
    std::remove(part.c_str());
    return text;
  }
  return {};
}

std::string read_memory_file(const std::string& path, const MemoryConfig& config, Octree* octree) {
  OctreeLimits limits;
  limits.keep_free = true;
  // A file that a memory has written can be read: each voxel a leaf, as far out as there are keys.
  limits.max_leaves = std::max(limits.max_leaves, config.max_nodes);
  limits.max_position = std::max(limits.max_position, (kKeyOrigin + 1) * config.resolution);
  double resolution = 0.0;
  std::string fault = read_octree_file(path, octree, limits, &resolution);
  if (!fault.empty()) return fault;
  const std::string name = "map file '" + path + "' ";
  if (!(std::abs(resolution - config.resolution) <= kSameResolution * config.resolution)) {
    std::ostringstream text;
    text << name << "has a resolution of " << resolution << " m, the memory's is "
         << config.resolution << " m: they must be the same.";
    return text.str();
  }
  // Coordinates of leaves are multiples of the file's resolution.
  const std::size_t most = config.max_nodes / kBlockVoxels;
  if (count_blocks(*octree, VoxelScale(resolution), most) > most) {
    return name + "needs memory for more voxels than allowed, which are " +
           std::to_string(config.max_nodes) + " (max_nodes).";
  }
  return {};
}

}  // namespace ist
