#include "cloud/thinning/voxel_thinning.h"

#include <cmath>
#include <cstring>
#include <tuple>

#include "cloud/thinning/voxel_kernel.h"

namespace ist {
namespace {

constexpr std::size_t kSmallestTable = 64;  // a power of two, as all of them

// The place of the origin within its voxel along an axis, in voxels.
float offset_in_voxel(double origin, double edge) {
  const double voxels = origin / edge;
  return static_cast<float>(voxels - std::floor(voxels));
}

// The integer of a voxel's number along an axis, which is a whole float. Numbers from 2^30 on have
// the integers of their bits, which are larger: no two numbers share one, however far a point is,
// and the edge of a voxel depends on no point.
std::int32_t as_integer(float number) {
  constexpr float kPlain = 1 << 30;
  const float size = std::abs(number);
  if (size < kPlain) return static_cast<std::int32_t>(number);
  std::int32_t bits = 0;
  static_assert(sizeof bits == sizeof size, "a float has 32 bits");
  std::memcpy(&bits, &size, sizeof bits);
  return number < 0.0F ? -bits : bits;
}

VoxelGrid make_grid(const Eigen::Matrix3d& R_FO, const Eigen::Vector3d& origin, double edge) {
  VoxelGrid grid;
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) grid.R[3 * i + k] = static_cast<float>(R_FO(i, k) / edge);
    grid.offset[i] = offset_in_voxel(origin[i], edge);
  }
  return grid;
}

}  // namespace

bool VoxelThinning::Entry::better_than(const Entry& other) const {
  if (offset_sq != other.offset_sq) return offset_sq < other.offset_sq;
  return std::tie(x, y, z, id) < std::tie(other.x, other.y, other.z, other.id);
}

void VoxelThinning::run(const PointBvh& all, double voxel_size, PointBvhBuilder* builder,
                        PointBvh* thinned) {
  // The table is sized for as many voxels as last time, and two thirds of it stay empty then.
  std::size_t table_size = kSmallestTable;
  while (table_size < 3 * entries_.size()) table_size *= 2;
  table_.assign(table_size, 0U);
  entries_.clear();
  recent_.fill(0);
  const Eigen::Matrix3d& R_FO = all.X_FO().linear();
  const Eigen::Vector3d& origin = all.X_FO().translation();
  const VoxelGrid grid = make_grid(R_FO, origin, voxel_size);
  TileVoxels voxels;
  PointTile scratch;
  for (std::size_t number = 0; number < all.tile_count(); ++number) {
    const PointTile& tile = all.tile(number, &scratch);
    const std::size_t count = find_voxels(grid, tile, &voxels);
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t k = voxels.nearest[i];
      const Voxel voxel{as_integer(voxels.x[k]), as_integer(voxels.y[k]), as_integer(voxels.z[k])};
      if (is_beaten(voxel, voxels.offset_sq[k])) continue;
      add({voxel, voxels.offset_sq[k], tile.x[k], tile.y[k], tile.z[k], tile.id[k]});
    }
  }

  points_.clear();
  for (const Entry& entry : entries_) {
    const Eigen::Vector3f p =
        (R_FO * Eigen::Vector3f(entry.x, entry.y, entry.z).cast<double>()).cast<float>();
    points_.push_back({p.x(), p.y(), p.z(), entry.id});
  }
  // Consecutive tiles are mostly neighbours, so consecutive entries are.
  builder->build_in_order(Eigen::Isometry3d(Eigen::Translation3d(origin)), points_, thinned);
}

// The usual case, on its own for speed: a voxel used a moment ago has a better point already.
inline bool VoxelThinning::is_beaten(const Voxel& voxel, float offset_sq) const {
  const std::uint32_t recent = recent_[voxel.place()];
  return recent < entries_.size() && entries_[recent].voxel == voxel &&
         entries_[recent].offset_sq < offset_sq;
}

void VoxelThinning::add(const Entry& entry) {
  const Voxel& voxel = entry.voxel;
  std::uint32_t& recent = recent_[voxel.place()];
  if (recent >= entries_.size() || !(entries_[recent].voxel == voxel)) {
    std::uint32_t* slot = find(voxel);
    if (*slot == 0) {
      recent = static_cast<std::uint32_t>(entries_.size());
      entries_.push_back(entry);
      *slot = recent + 1;
      if (2 * entries_.size() > table_.size()) grow();
      return;
    }
    recent = *slot - 1;
  }
  if (entry.better_than(entries_[recent])) entries_[recent] = entry;
}

// Voxels of a cube of 4 x 4 x 4 are neighbours in the table, so that neighbours in space share
// cache lines.
std::size_t VoxelThinning::hash(const Voxel& voxel) {
  constexpr std::uint32_t kBits = 2;
  const auto x = static_cast<std::uint32_t>(voxel.x), y = static_cast<std::uint32_t>(voxel.y),
             z = static_cast<std::uint32_t>(voxel.z);
  // Odd numbers near 2^64 over the golden ratio, the plastic number and its square.
  std::uint64_t h = (x >> kBits) * 0x9E3779B97F4A7C15ULL ^ (y >> kBits) * 0xC13FA9A902A6328FULL ^
                    (z >> kBits) * 0x91E10DA5C79E7B1DULL;
  h ^= h >> 32;
  const std::uint32_t within = (x & 3U) | (y & 3U) << 2 | (z & 3U) << 4;
  return static_cast<std::size_t>((h * 0x9E3779B97F4A7C15ULL >> 26) << (3 * kBits) | within);
}

// The slot that holds a voxel, or the empty one where it belongs.
std::uint32_t* VoxelThinning::find(const Voxel& voxel) {
  const std::size_t mask = table_.size() - 1;
  std::size_t i = hash(voxel) & mask;
  while (table_[i] != 0 && !(entries_[table_[i] - 1].voxel == voxel)) i = (i + 1) & mask;
  return &table_[i];
}

void VoxelThinning::grow() {
  table_.assign(2 * table_.size(), 0U);
  for (std::size_t i = 0; i < entries_.size(); ++i) {
    *find(entries_[i].voxel) = static_cast<std::uint32_t>(i + 1);
  }
}

}  // namespace ist
