#include "cloud/filters/thinning.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "cloud/filters/thinning_kernel.h"

namespace ist {
namespace {

constexpr std::size_t kSmallestTable = 64;  // a power of two, as all of them
constexpr double kMostCells = 1 << 30;      // from the origin to either side

// Of the origin, in cells from the one it lies in.
float offset_in_cell(double origin, double edge) {
  const double cells = origin / edge;
  return static_cast<float>(cells - std::floor(cells));
}

// Cells are larger where their numbers would not fit: across more than two billion of them.
double fitting(double cell, const PointBvh& all) {
  if (all.empty()) return cell;
  const float reach = all.bounds().min().cwiseAbs().cwiseMax(all.bounds().max().cwiseAbs()).norm();
  return std::max(cell, static_cast<double>(reach) / kMostCells);
}

CellGrid make_grid(const Eigen::Matrix3d& R_FO, const Eigen::Vector3d& origin, double edge) {
  CellGrid grid;
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) grid.turn[3 * i + k] = static_cast<float>(R_FO(i, k) / edge);
    grid.offset[i] = offset_in_cell(origin[i], edge);
  }
  return grid;
}

}  // namespace

bool Thinning::Entry::better_than(const Entry& other) const {
  if (off_centre != other.off_centre) return off_centre < other.off_centre;
  return std::tie(x, y, z, id) < std::tie(other.x, other.y, other.z, other.id);
}

void Thinning::run(const PointBvh& all, double cell_size, PointBvhBuilder* builder,
                   PointBvh* thin) {
  // As many cells as last time; a third of the table stays empty even then.
  std::size_t table_size = kSmallestTable;
  while (table_size < 3 * entries_.size()) table_size *= 2;
  table_.assign(table_size, 0U);
  entries_.clear();
  recent_.fill(0);
  const Eigen::Matrix3d& R_FO = all.X_FO().linear();
  const Eigen::Vector3d& origin = all.X_FO().translation();
  const CellGrid grid = make_grid(R_FO, origin, fitting(cell_size, all));
  TileCells cells;
  PointTile room;
  for (std::size_t number = 0; number < all.tile_count(); ++number) {
    const PointTile& tile = all.tile(number, &room);
    const std::size_t count = find_cells(grid, tile, &cells);
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t k = cells.nearest[i];
      const Cell cell{static_cast<std::int32_t>(cells.x[k]), static_cast<std::int32_t>(cells.y[k]),
                      static_cast<std::int32_t>(cells.z[k])};
      if (is_beaten(cell, cells.off_centre[k])) continue;
      add({cell, cells.off_centre[k], tile.x[k], tile.y[k], tile.z[k], tile.id[k]});
    }
  }

  points_.clear();
  for (const Entry& entry : entries_) {
    const Eigen::Vector3f p =
        (R_FO * Eigen::Vector3f(entry.x, entry.y, entry.z).cast<double>()).cast<float>();
    points_.push_back({p.x(), p.y(), p.z(), entry.id});
  }
  // Neighbours among the tiles have given neighbours.
  builder->build_in_order(Eigen::Isometry3d(Eigen::Translation3d(origin)), points_, thin);
}

// The usual case, on its own for speed: a cell seen a moment ago has a better point already.
inline bool Thinning::is_beaten(const Cell& cell, float off_centre) const {
  const std::uint32_t recent = recent_[cell.place()];
  return recent < entries_.size() && entries_[recent].cell == cell &&
         entries_[recent].off_centre < off_centre;
}

void Thinning::add(const Entry& entry) {
  const Cell& cell = entry.cell;
  std::uint32_t& recent = recent_[cell.place()];
  if (recent >= entries_.size() || !(entries_[recent].cell == cell)) {
    std::uint32_t* slot = find(cell);
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

// Cells of a cube of 4 x 4 x 4 are neighbours in the table: what is near in space is in the cache.
std::size_t Thinning::hash(const Cell& cell) {
  constexpr std::uint32_t kBits = 2;
  const auto x = static_cast<std::uint32_t>(cell.x), y = static_cast<std::uint32_t>(cell.y),
             z = static_cast<std::uint32_t>(cell.z);
  // Odd numbers near 2^64 over the golden ratio, the plastic number and its square.
  std::uint64_t h = (x >> kBits) * 0x9E3779B97F4A7C15ULL ^ (y >> kBits) * 0xC13FA9A902A6328FULL ^
                    (z >> kBits) * 0x91E10DA5C79E7B1DULL;
  h ^= h >> 32;
  const std::uint32_t within = (x & 3U) | (y & 3U) << 2 | (z & 3U) << 4;
  return static_cast<std::size_t>((h * 0x9E3779B97F4A7C15ULL >> 26) << (3 * kBits) | within);
}

// The slot that holds a cell, or the empty one where it belongs.
std::uint32_t* Thinning::find(const Cell& cell) {
  const std::size_t mask = table_.size() - 1;
  std::size_t i = hash(cell) & mask;
  while (table_[i] != 0 && !(entries_[table_[i] - 1].cell == cell)) i = (i + 1) & mask;
  return &table_[i];
}

void Thinning::grow() {
  table_.assign(2 * table_.size(), 0U);
  for (std::size_t i = 0; i < entries_.size(); ++i) {
    *find(entries_[i].cell) = static_cast<std::uint32_t>(i + 1);
  }
}

}  // namespace ist
