// This decides which points near the robot are obstacles, by the means of heights in tiles of the
// image, and by pixels next to one another.

#include <algorithm>
#include <array>
#include <bitset>
#include <cmath>

#include "cloud/filters/crop.h"
#include "cloud/filters/view_filter.h"
#include "cloud/format/point_reader.h"
#include "internal/geometry/numbers.h"

namespace ist {
namespace {

// [standard deviations] A mean that is more in front is an obstacle next to another one.
constexpr double kBesideObstacle = 3.0;
// [pixels] by which an obstacle is continued toward the robot, where its pixels are in front by no
// more than the noise. On the robot's own surface a sixth of the pixels is; that does not
// percolate.
constexpr int kRings = 3;
// Pixels of an obstacle, its part outside the skin included.
constexpr int kFewestPixels = 3;

}  // namespace

// Whether an obstacle was beside this tile's points, outside the skin, a cloud ago.
bool ViewFilter::came_in(const Tile& tile) const {
  const Eigen::Vector3d p_F = X_FS_ * tile.p_S.cast<double>();
  for (int i = 0; i < 27; ++i) {
    if (std::binary_search(outside_before_.begin(), outside_before_.end(),
                           voxel(p_F, i / 9 - 1, i / 3 % 3 - 1, i % 3 - 1))) {
      return true;
    }
  }
  return false;
}

// Whether the mean height is more than noise and systematic errors make of the robot's own surface.
bool ViewFilter::is_in_front(double sum, double variance, int count, double tolerance,
                             double sigmas) const {
  return count > 0 && sum > sigmas * std::sqrt(variance) + count * tolerance;
}

// [m] A surface has no larger step from one pixel to the next.
float ViewFilter::largest_step(float range) const {
  return static_cast<float>(padding_ + kFront * config_.noise.sigma(static_cast<double>(range)));
}

// Whether neighbouring tiles may show one surface, or an obstacle on it.
bool ViewFilter::is_same_surface(const Tile& a, const Tile& b) const {
  if (a.link == nullptr || b.link == nullptr) return true;
  const float range = a.p_S.norm();
  return std::abs(b.p_S.norm() - range) <= largest_step(range);
}

// Whether the pixels of a tile that show the same surface as pixel k are in front, by their mean.
bool ViewFilter::is_surface_in_front(const Tile& tile, std::size_t k) const {
  const float step = largest_step(tile.range[k]);
  const float variance = tile.variance / static_cast<float>(tile.count);
  double sum = 0.0;
  int count = 0;
  for (std::size_t j = 0; j < kPixels; ++j) {
    if (!(std::abs(tile.range[j] - tile.range[k]) <= step) || std::isnan(tile.height[j])) continue;
    sum += static_cast<double>(tile.height[j]);
    ++count;
  }
  return is_in_front(sum, static_cast<double>(variance) * count, count,
                     static_cast<double>(tile.tolerance), 0.5 * kBesideObstacle);
}

// A tile, or a window of two by two tiles, that is in front of the robot for certain.
void ViewFilter::find_windows(std::size_t index) {
  std::array<Tile*, 4> window = {};
  double sum = 0.0, variance = 0.0, tolerance = 0.0;
  int count = 0;
  const std::int64_t row = tiles_[index].row / kTileSide, column = tiles_[index].column / kTileSide;
  for (std::size_t i = 0; i < 4; ++i) {
    window[i] =
        tile_at(row + static_cast<std::int64_t>(i / 2), column + static_cast<std::int64_t>(i % 2));
    if (window[i] == nullptr) continue;
    if (!is_same_surface(tiles_[index], *window[i])) {
      window[i] = nullptr;
      continue;
    }
    const Tile& t = *window[i];
    sum += static_cast<double>(t.sum);
    variance += static_cast<double>(t.variance);
    count += t.count;
    tolerance = std::max(tolerance, static_cast<double>(t.tolerance));
  }
  const bool whole = is_in_front(sum, variance, count, tolerance, kCertain);
  for (Tile* tile : window) {
    if (tile == nullptr || tile->is_obstacle) continue;
    const double own = tile == &tiles_[index] ? kCertain : kInfinity;
    const double sigmas = whole ? 0.5 * kBesideObstacle : own;
    tile->is_obstacle =
        std::isfinite(sigmas) &&
        is_in_front(static_cast<double>(tile->sum), static_cast<double>(tile->variance),
                    tile->count, static_cast<double>(tile->tolerance), sigmas);
  }
}

// Next to an obstacle in the image, or to where one was a cloud ago, less evidence is needed.
void ViewFilter::grow() {
  front_.clear();
  const auto is_weak = [this](const Tile& t) {
    return !t.is_obstacle &&
           is_in_front(static_cast<double>(t.sum), static_cast<double>(t.variance), t.count,
                       static_cast<double>(t.tolerance), kBesideObstacle);
  };
  for (std::size_t i = 0; i < tiles_.size(); ++i) {
    Tile& tile = tiles_[i];
    if (is_weak(tile) && came_in(tile)) tile.is_obstacle = true;
    if (tile.is_obstacle || tile.obstacle != 0) front_.push_back(i);
  }
  while (!front_.empty()) {
    const Tile& from = tiles_[front_.back()];
    front_.pop_back();
    const std::int64_t row = from.row / kTileSide, column = from.column / kTileSide;
    for (std::int64_t i = 0; i < 9; ++i) {
      Tile* tile = tile_at(row + i / 3 - 1, column + i % 3 - 1);
      if (tile == nullptr || !is_weak(*tile) || !is_same_surface(from, *tile)) continue;
      tile->is_obstacle = true;
      front_.push_back(static_cast<std::size_t>(tile - tiles_.data()));
    }
  }
}

// The pixels of a tile and its neighbours that are obstacles, in the skin or out of it.
// @param outside  pixels outside the skin that count
int ViewFilter::count_obstacles(std::int64_t row, std::int64_t column, Outside outside) const {
  int count = 0;
  for (std::int64_t i = 0; i < 9; ++i) {
    const Tile* tile = tile_at(row + i / 3 - 1, column + i % 3 - 1);
    if (tile == nullptr) continue;
    const unsigned others = outside == Outside::kInFront ? static_cast<unsigned>(tile->front)
                                                         : static_cast<unsigned>(tile->kept) &
                                                               ~static_cast<unsigned>(tile->skin);
    count += static_cast<int>(std::bitset<16>(others | tile->obstacle).count());
  }
  return count;
}

// The pixels of a tile that are not the robot's, no farther than `last` [m].
int ViewFilter::count_others(std::int64_t row, std::int64_t column, float last) const {
  int count = 0;
  if (const Tile* tile = tile_at(row, column)) {
    const unsigned others =
        (static_cast<unsigned>(tile->kept) & ~static_cast<unsigned>(tile->skin)) | tile->obstacle;
    for (std::size_t k = 0; k < kPixels; ++k) {
      count += (others >> k & 1U) != 0 && tile->range[k] <= last ? 1 : 0;
    }
    return count;
  }
  // None of a tile that was not added is near the robot.
  constexpr auto kSide = static_cast<std::int64_t>(kTileSide);
  const std::int64_t first_row = std::max<std::int64_t>(row, 0) * kSide,
                     first_column = std::max<std::int64_t>(column, 0) * kSide;
  const std::int64_t end_row =
                         std::min((row + 1) * kSide, static_cast<std::int64_t>(cloud_->height)),
                     end_column =
                         std::min((column + 1) * kSide, static_cast<std::int64_t>(cloud_->width));
  for (std::int64_t r = first_row; r < end_row; ++r) {
    for (std::int64_t c = first_column; c < end_column; ++c) {
      const double range =
          point_at(*cloud_, static_cast<std::size_t>(r), static_cast<std::size_t>(c)).norm();
      count += range > 0.0 && range <= static_cast<double>(last) ? 1 : 0;
    }
  }
  return count;
}

// Whether a pixel outside the skin has fewer pixels with it than an obstacle has: others that are
// not the robot's, no farther behind it than a surface's step.
bool ViewFilter::is_alone(const Tile& tile, std::size_t k) const {
  const float last = tile.range[k] + largest_step(tile.range[k]);
  const std::int64_t row = tile.row / kTileSide, column = tile.column / kTileSide;
  int count = 0;
  for (std::int64_t i = 0; i < 9; ++i) {
    count += count_others(row + i / 3 - 1, column + i % 3 - 1, last);
  }
  return count < kFewestPixels;
}

// In a minute a camera sees some 10^8 pixels of the robot, of which chance takes a few for
// obstacles, each by itself.
void ViewFilter::drop_speckles() {
  for (Tile& tile : tiles_) {
    tile.near = tile.obstacle;
    const std::int64_t row = tile.row / kTileSide, column = tile.column / kTileSide;
    tile.is_speckle =
        tile.front != 0 && count_obstacles(row, column, Outside::kInFront) < kFewestPixels;
    for (std::size_t k = 0; tile.stray != 0 && k < kPixels; ++k) {
      if ((tile.stray >> k & 1U) == 0 || is_alone(tile, k)) continue;
      tile.stray &= static_cast<std::uint16_t>(~(1U << k));
    }
    if (tile.obstacle == 0 || tile.is_obstacle) continue;
    if (count_obstacles(row, column, Outside::kAll) < kFewestPixels) tile.near = 0;
  }
  for (Tile& tile : tiles_) {
    tile.obstacle = tile.near;
    tile.robot |= tile.stray;
    tile.front &= static_cast<std::uint16_t>(~tile.stray);
    if (tile.is_speckle) tile.front = 0;
  }
}

// Whether a pixel is an obstacle whose surface may go on at this range [m]: what ends far behind or
// in front of it is another surface.
bool ViewFilter::continues(std::int64_t row, std::int64_t column, float range, float step) const {
  if (row < 0 || column < 0) return false;
  const Tile* tile = tile_at(row / static_cast<std::int64_t>(kTileSide),
                             column / static_cast<std::int64_t>(kTileSide));
  if (tile == nullptr) return false;
  const auto k = static_cast<std::size_t>(row % static_cast<std::int64_t>(kTileSide) *
                                              static_cast<std::int64_t>(kTileSide) +
                                          column % static_cast<std::int64_t>(kTileSide));
  return (static_cast<unsigned>(tile->obstacle | tile->front) >> k & 1U) != 0 &&
         std::abs(tile->range[k] - range) <= step;
}

// A pixel that may be blurred, or that is in front of the robot, is an obstacle next to a pixel of
// an obstacle that goes on there.
// @param sigmas  standard deviations by which it must be in front
void ViewFilter::grow_pixels(float sigmas) {
  for (Tile& tile : tiles_) {
    if (count_obstacles(tile.row / kTileSide, tile.column / kTileSide, Outside::kAll) == 0) {
      continue;
    }
    const float noise =
        tile.count > 0 ? std::sqrt(tile.variance / static_cast<float>(tile.count)) : 0.0F;
    const float least = sigmas * noise;
    for (std::size_t k = 0; k < kPixels; ++k) {
      const auto bit = static_cast<std::uint16_t>(1U << k);
      if ((tile.blurred & bit) == 0 && !(tile.height[k] > least)) continue;
      const auto row = static_cast<std::int64_t>(tile.row + k / kTileSide),
                 column = static_cast<std::int64_t>(tile.column + k % kTileSide);
      const float step = largest_step(tile.range[k]);
      for (std::int64_t i = 0; i < 9; ++i) {
        if (continues(row + i / 3 - 1, column + i % 3 - 1, tile.range[k], step)) tile.near |= bit;
      }
    }
  }
  for (Tile& tile : tiles_) tile.obstacle |= tile.near;
}

void ViewFilter::find_obstacles() {
  for (std::size_t i = 0; i < tiles_.size(); ++i) find_windows(i);
  grow();
  for (Tile& tile : tiles_) {
    for (std::size_t k = 0; tile.is_obstacle && k < kPixels; ++k) {
      if (!(tile.height[k] > 0.0F)) continue;
      if (!tile.is_patch && !is_surface_in_front(tile, k)) continue;
      tile.obstacle |= static_cast<std::uint16_t>(1U << k);
    }
  }
  drop_speckles();
  for (Tile& tile : tiles_) tile.certain = tile.obstacle;
  grow_pixels(0.0F);
  for (int ring = 1; ring < kRings; ++ring) grow_pixels(1.0F);
}

}  // namespace ist
