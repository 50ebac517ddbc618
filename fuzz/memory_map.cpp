// The memory: scans, times, bodies and files one after the other, with numbers that are hard. What
// is remembered stays within its bounds, what a scan hits is known, and what is hidden is occupied.
// Covers: src/cloud/memory/voxel_map.cpp src/cloud/memory/voxel_ray.h
// src/cloud/memory/voxel_blocks.cpp Covers: src/cloud/memory/memory_map.cpp
// src/cloud/memory/octree_writer.cpp Covers: src/cloud/memory/merge_boxes.cpp
// src/cloud/memory/seen_space.cpp

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <vector>

#include "ist_proximity/cloud/memory_map.h"
#include "ist_proximity/cloud/octree.h"
#include "ist_proximity/cloud/seen_space.h"
#include "support/byte_reader.h"
#include "support/check.h"

namespace {

using ist::fuzz::ByteReader;

constexpr int kSteps = 40;
constexpr std::size_t kMostEnds = 8;

ist::MemoryConfig read_config(ByteReader* in) {
  constexpr double kResolutions[] = {0.001, 0.02, 0.1, 1.0};
  ist::MemoryConfig config;
  config.resolution = kResolutions[in->below(4)];
  config.max_nodes = 4096 + 512 * in->below(64);
  config.decay = in->flag() ? 10.0 : std::max(std::abs(in->number(5.0)), 1e-3);
  if (std::isnan(config.decay)) config.decay = 1.0;
  config.discretize = in->flag();
  config.max_range = in->between(0.01, 200.0) * config.resolution;
  return config;
}

Eigen::Vector3f read_point(ByteReader* in, double size) {
  const double x = in->number(size), y = in->number(size), z = in->number(size);
  return Eigen::Vector3d(x, y, z).cast<float>();
}

void insert(ByteReader* in, bool has_region, ist::MemoryMap* map) {
  const double size = 100.0 * map->config().resolution;
  ist::MemoryScan scan;
  scan.stamp = in->number(100.0);
  scan.origin = read_point(in, size);
  for (std::size_t i = in->below(kMostEnds); i > 0; --i) scan.hits.push_back(read_point(in, size));
  for (std::size_t i = in->below(kMostEnds); i > 0; --i) {
    scan.free_ends.push_back(read_point(in, size));
  }
  try {
    map->insert(scan);
  } catch (const std::invalid_argument&) {
    FUZZ_CHECK(!scan.origin.allFinite(), "a finite origin is refused%s", "");
    return;
  }
  if (has_region || map->counts().skipped > 0) return;
  for (const Eigen::Vector3f& p : scan.hits) {
    const double reach = (p - scan.origin).cast<double>().norm() + 2.0 * map->config().resolution;
    const double most = 32767.0 * map->config().resolution;
    if (!(reach < map->config().max_range && p.cwiseAbs().maxCoeff() < most)) continue;
    FUZZ_CHECK(map->state(p.cast<double>()) != ist::VoxelState::kUnknown,
               "the hit at %g %g %g is unknown", p.x(), p.y(), p.z());
  }
}

void write_and_read(const ist::MemoryMap& map) {
  const std::vector<std::uint8_t> bytes = map.octree_bytes();
  ist::OctreeData data;
  data.id = "OcTree";
  data.is_binary = true;
  data.resolution = map.config().resolution;
  data.data = bytes.data();
  data.size = bytes.size();
  ist::OctreeLimits limits;
  limits.keep_free = true;
  limits.max_position = 1e9;
  ist::Octree octree;
  const std::string fault = ist::read_octree(data, &octree, limits);
  FUZZ_CHECK(fault.empty(), "what was written cannot be read: %s", fault.c_str());
  const auto voxels = [&](const ist::VoxelBoxes& leaves) {
    double count = 0.0;
    for (const auto& leaf : leaves)
      count += (leaf.sizes() / data.resolution).array().round().prod();
    return static_cast<std::size_t>(count);
  };
  const ist::MemoryCounts counts = map.counts();
  FUZZ_CHECK(voxels(octree.occupied) == counts.occupied, "%zu occupied, written %zu",
             counts.occupied, voxels(octree.occupied));
  FUZZ_CHECK(voxels(octree.occupied) + voxels(octree.free_leaves) == counts.known,
             "%zu known, written %zu", counts.known, voxels(octree.free_leaves));
}

void check(const ist::MemoryMap& map) {
  const ist::MemoryCounts counts = map.counts();
  FUZZ_CHECK(counts.nodes <= map.config().max_nodes, "%zu nodes", counts.nodes);
  FUZZ_CHECK(counts.occupied <= counts.known && counts.known <= counts.nodes, "%zu occupied",
             counts.occupied);
  ist::VoxelBoxes boxes;
  map.hidden_boxes(&boxes);
  for (const Eigen::AlignedBox3d& box : boxes) {
    const Eigen::Vector3d p = box.min().array() + 0.5 * map.config().resolution;
    FUZZ_CHECK(map.state(p) == ist::VoxelState::kOccupied, "a hidden box is not occupied: %g",
               p.x());
  }
}

void look_at_unknown(ByteReader* in, const ist::MemoryMap& map) {
  ist::SeenSpace seen;
  seen.add(map);
  const double r = map.config().resolution;
  const Eigen::Vector3d center = in->flag() ? in->vector(33000.0 * r) : in->vector(50.0 * r);
  const Eigen::Vector3d p = center + in->vector(6.0 * r);
  ist::VoxelBoxes boxes;
  if (!seen.unknown_boxes(center, 12.0 * r, 100000, &boxes)) return;
  bool is_held = false;
  for (const Eigen::AlignedBox3d& box : boxes) is_held = is_held || box.contains(p);
  FUZZ_CHECK(is_held || !std::isnan(seen.time_seen(p)), "neither seen nor unknown: %g %g %g", p.x(),
             p.y(), p.z());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  ByteReader in(data, size);
  ist::MemoryMap map(read_config(&in));
  const double r = map.config().resolution;
  bool has_region = false;
  for (int step = 0; step < kSteps && in.left() > 0; ++step) {
    switch (in.below(8)) {
      case 0:
        map.forget(in.number(200.0));
        break;
      case 1: {
        const Eigen::Vector3f c = read_point(&in, 100.0 * r);
        const Eigen::Vector4f sphere(c.x(), c.y(), c.z(), static_cast<float>(in.between(0, 9) * r));
        map.note_free({&sphere, 1}, in.number(100.0));
        break;
      }
      case 2: {
        ist::RegionOfInterest region;
        region.center_F = in.vector(100.0 * r);
        region.radius = in.between(0.0, 100.0) * r;
        map.set_region(region);
        has_region = true;
        break;
      }
      case 3:
        write_and_read(map);
        look_at_unknown(&in, map);
        break;
      default:
        insert(&in, has_region, &map);
    }
    check(map);
  }
  return 0;
}
