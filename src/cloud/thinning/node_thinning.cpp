#include "cloud/thinning/node_thinning.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <tuple>

#include "cloud/thinning/voxel_kernel.h"
#include "internal/bvh/traversal_stack.h"

namespace ist {
namespace {

// Bound of the rounding of a point's place in the grid, as a share of the coordinates involved.
constexpr double kRounding = 1e-6;

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

void write_unused(ThinnedTile* tile) {
  for (int k = tile->count; k < kPointWidth; ++k) {
    tile->x[k] = tile->y[k] = tile->z[k] = kFarAway;
    tile->id[k] = 0;
    tile->weight[k] = 0.0F;
  }
}

void find_box(ThinnedTile* tile) {
  const auto n = static_cast<std::size_t>(tile->count);
  const auto range = [n](const float* v, float* min, float* max) {
    const auto [least, most] = std::minmax_element(v, v + n);
    *min = *least;
    *max = *most;
  };
  range(tile->x, tile->box.min_x, tile->box.max_x);
  range(tile->y, tile->box.min_y, tile->box.max_y);
  range(tile->z, tile->box.min_z, tile->box.max_z);
}

void find_moments(ThinnedTile* tile) {
  PointMoments moments = {};
  const auto n = static_cast<std::size_t>(tile->count);
  for (std::size_t k = 0; k < n; ++k) {
    moments.weight += tile->weight[k];
    moments.middle[0] += tile->weight[k] * tile->x[k];
    moments.middle[1] += tile->weight[k] * tile->y[k];
    moments.middle[2] += tile->weight[k] * tile->z[k];
  }
  for (float& m : moments.middle) m /= moments.weight;
  for (std::size_t k = 0; k < n; ++k) {
    const float x = tile->x[k] - moments.middle[0], y = tile->y[k] - moments.middle[1],
                z = tile->z[k] - moments.middle[2], w = tile->weight[k];
    const float products[6] = {x * x, y * y, z * z, x * y, y * z, z * x};
    for (int i = 0; i < 6; ++i) moments.spread[i] += w * products[i];
  }
  tile->moments = moments;
}

}  // namespace

bool NodeThinning::Candidate::is_better_than(const Candidate& other) const {
  if (offset_sq != other.offset_sq) return offset_sq < other.offset_sq;
  return std::tie(x, y, z, id) < std::tie(other.x, other.y, other.z, other.id);
}

void NodeThinning::run(std::int32_t node, ThinnedNode* thinned) {
  collect(all_.nodes()[static_cast<std::size_t>(node)]);
  find_rivals(node);
  write(thinned);
}

// Calls visit(candidate) for the points of a tile that are nearest to the centre of their voxel.
template <typename Visit>
void NodeThinning::for_each_candidate(const PointTile& tile, const Visit& visit) const {
  TileVoxels voxels;
  const std::size_t count = find_voxels(grid_, tile, &voxels);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t k = voxels.nearest[i];
    visit(Candidate{{as_integer(voxels.x[k]), as_integer(voxels.y[k]), as_integer(voxels.z[k])},
                    {voxels.x[k], voxels.y[k], voxels.z[k]},
                    voxels.offset_sq[k],
                    tile.x[k],
                    tile.y[k],
                    tile.z[k],
                    tile.id[k]});
  }
}

// The table's entry of a voxel, or the empty one where it belongs. The table is never full.
std::uint16_t* NodeThinning::find(const Candidate& candidate) {
  const std::int32_t* v = candidate.voxel;
  const auto x = static_cast<std::uint32_t>(v[0]), y = static_cast<std::uint32_t>(v[1]),
             z = static_cast<std::uint32_t>(v[2]);
  // Odd numbers near 2^32 over the golden ratio, the plastic number and its square.
  const std::uint32_t h = x * 0x9E3779B1U ^ y * 0xC13FA9A9U ^ z * 0x91E10DA5U;
  for (std::size_t i = (h ^ h >> 15) % kTableSize;; i = (i + 1) % kTableSize) {
    if (table_[i] == kEmpty) return &table_[i];
    if (std::equal(v, v + 3, candidates_[table_[i]].voxel)) return &table_[i];
  }
}

void NodeThinning::collect(const BoxNode& node) {
  table_.fill(kEmpty);
  PointTile scratch;
  for (int i = 0; i < node.count; ++i) {
    const PointTile& tile = all_.tile(static_cast<std::size_t>(~node.child[i]), &scratch);
    for_each_candidate(tile, [this](const Candidate& candidate) { add(candidate); });
  }
  undefeated_ = count_;
}

void NodeThinning::add(const Candidate& candidate) {
  std::uint16_t* const entry = find(candidate);
  if (*entry == kEmpty) {
    *entry = static_cast<std::uint16_t>(count_);
    candidates_[count_++] = candidate;
  } else if (candidate.is_better_than(candidates_[*entry])) {
    candidates_[*entry] = candidate;
  }
}

// The places that are no farther from the centre of a candidate's voxel than itself.
void NodeThinning::set_spheres() {
  RivalSpheres& s = spheres_;
  s.count = count_;
  std::fill_n(s.min, 3, std::numeric_limits<float>::max());
  std::fill_n(s.max, 3, std::numeric_limits<float>::lowest());
  for (std::size_t i = 0; i < count_; ++i) {
    const Candidate& c = candidates_[i];
    const double p[3] = {c.x, c.y, c.z};
    double to_center[3];  // along the grid's axes, in voxels
    for (int axis = 0; axis < 3; ++axis) {
      const float* r = grid_.R + 3 * axis;
      const double place = static_cast<double>(r[0]) * p[0] + static_cast<double>(r[1]) * p[1] +
                           static_cast<double>(r[2]) * p[2] +
                           static_cast<double>(grid_.offset[axis]);
      to_center[axis] = static_cast<double>(c.number[axis]) + 0.5 - place;
    }
    // Rivals are near, so their coordinates are as large.
    const double rounding =
        kRounding * (std::abs(p[0]) + std::abs(p[1]) + std::abs(p[2]) + 2.0 * grid_.edge);
    const double radius = grid_.edge * std::sqrt(static_cast<double>(c.offset_sq)) + rounding;
    float* const center[3] = {s.x.data(), s.y.data(), s.z.data()};
    for (int k = 0; k < 3; ++k) {
      // The transpose of R, which is a rotation over the edge, is its inverse over the edge's
      // square.
      double moved = 0.0;
      for (int axis = 0; axis < 3; ++axis) {
        moved += static_cast<double>(grid_.R[3 * axis + k]) * to_center[axis];
      }
      const double place = p[k] + grid_.edge * grid_.edge * moved;
      center[k][i] = static_cast<float>(place);
      s.min[k] = std::min(s.min[k], static_cast<float>(place - radius));
      s.max[k] = std::max(s.max[k], static_cast<float>(place + radius));
    }
    s.radius_sq[i] = static_cast<float>(radius * radius);
  }
  for (std::size_t i = count_; i % kPointWidth != 0; ++i) {
    s.x[i] = s.y[i] = s.z[i] = kFarAway;
    s.radius_sq[i] = 0.0F;
  }
}

// Visits the tiles of other nodes that may hold a rival, the most likely first, until every
// candidate is defeated.
void NodeThinning::find_rivals(std::int32_t own_node) {
  if (count_ == 0) return;
  set_spheres();
  struct Entry {
    std::int32_t child;
    float gap;
  };
  PointTile scratch;
  TraversalStack<Entry, stack_capacity(kMaxBoxLevels, kBoxWidth)> stack;
  stack.push({all_.root(), 0.0F});
  while (!stack.empty() && undefeated_ > 0) {
    const std::int32_t child = stack.pop().child;
    if (child == own_node) continue;
    if (child < 0) {
      const PointTile& tile = all_.tile(static_cast<std::size_t>(~child), &scratch);
      for_each_candidate(tile, [this](const Candidate& rival) { challenge(rival); });
      continue;
    }
    const BoxNode& node = all_.nodes()[static_cast<std::size_t>(child)];
    const std::size_t first = stack.size();
    float gaps[kBoxWidth];
    const std::uint32_t near = find_rival_children(node, spheres_, gaps);
    for (int k = 0; near >> k != 0; ++k) {
      if ((near >> k & 1U) == 0) continue;
      stack.push_least_on_top<&Entry::gap>(first, {node.child[k], gaps[k]});
    }
  }
}

void NodeThinning::challenge(const Candidate& rival) {
  const std::uint16_t entry = *find(rival);
  if (entry == kEmpty || spheres_.radius_sq[entry] < 0.0F) return;
  if (!rival.is_better_than(candidates_[entry])) return;
  spheres_.x[entry] = spheres_.y[entry] = spheres_.z[entry] = kFarAway;
  spheres_.radius_sq[entry] = -1.0F;
  --undefeated_;
}

void NodeThinning::write(ThinnedNode* thinned) const {
  thinned->count = 0;
  ThinnedTile* tile = nullptr;
  for (std::size_t i = 0; i < count_; ++i) {
    if (spheres_.radius_sq[i] < 0.0F) continue;
    if (tile == nullptr || tile->count == kPointWidth) {
      tile = &thinned->tiles[thinned->count++];
      tile->count = 0;
    }
    const Candidate& candidate = candidates_[i];
    const int k = tile->count++;
    tile->x[k] = candidate.x;
    tile->y[k] = candidate.y;
    tile->z[k] = candidate.z;
    tile->id[k] = candidate.id;
    tile->weight[k] = cell_weight(candidate.offset_sq);
  }
  for (std::uint32_t i = 0; i < thinned->count; ++i) {
    write_unused(&thinned->tiles[i]);
    find_box(&thinned->tiles[i]);
    find_moments(&thinned->tiles[i]);
  }
}

}  // namespace ist
