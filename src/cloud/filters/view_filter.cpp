#include "cloud/filters/view_filter.h"

#include <algorithm>
#include <bitset>
#include <cmath>
#include <limits>

namespace ist {
namespace {

// Standard deviations of the sensor's corrected pose.
constexpr double kPose = 3.0;
// Passes of the first cloud with a larger padding, which falls from pass to pass: where the
// sensor's pose is as wrong as is stated, few of the robot's points are within the padding at
// first.
constexpr int kWidePasses = 3;
constexpr unsigned kSearchEvery = 16;  // clouds, without the robot in view

constexpr double kUnknownSpeed = 1.0;  // [m/s] of a link that was not there a cloud ago
constexpr double kLongestStep = 0.5;   // [s] between two clouds, for a speed
// [m] Edge of a voxel of what was outside the skin: at 30 Hz what moves at 1 m/s stays a neighbour.
constexpr double kVoxel = 0.04;

}  // namespace

ViewFilter::ViewFilter(const ViewFilterConfig& config, double padding)
    : config_(config), padding_(padding), skin_(padding), calibration_(config) {}

void ViewFilter::begin_cloud(Span<const PosedSolid> solids, double stamp) {
  links_.swap(last_links_);
  last_stamp_ = stamp_;
  stamp_ = stamp;
  links_.assign(solids.size(), {});
  view_.reserve(solids.size());
  const double step = stamp_ - last_stamp_;
  for (std::size_t i = 0; i < solids.size(); ++i) {
    LinkState& link = links_[i];
    link.tree = solids[i].tree;
    link.X_FL = solids[i].X_FL;
    link.speed = kUnknownSpeed;
    const auto before = std::find_if(last_links_.begin(), last_links_.end(),
                                     [&](const LinkState& l) { return l.tree == link.tree; });
    if (before == last_links_.end() || !(step > 0.0 && step < kLongestStep)) continue;
    const Eigen::Vector3d& center = link.tree->center();
    const double turned = (link.X_FL.linear() - before->X_FL.linear()).norm();
    link.speed =
        ((link.X_FL * center - before->X_FL * center).norm() + link.tree->radius() * turned) / step;
  }
  outside_before_.swap(outside_);
  // A robot that is out of view is not looked for in every cloud.
  const bool may_see = !tiles_.empty() || searched_++ % kSearchEvery == 0;
  first_passes_ = calibration_.has_estimate() || !may_see ? 0 : kWidePasses + 1;
  calibration_.begin_cloud();
}

double ViewFilter::begin_pass(const RawCloud& cloud, const Eigen::Isometry3d& X_FS) {
  cloud_ = &cloud;
  X_FS_ = X_FS;
  const std::size_t wide = (cloud.width + kTileSide - 1) / kTileSide,
                    high = (cloud.height + kTileSide - 1) / kTileSide;
  if (wide != tiles_wide_ || high != tiles_high_) {
    tiles_wide_ = wide;
    tiles_high_ = high;
    tile_index_.assign(wide * high, -1);
  } else {
    for (const Tile& tile : tiles_) {
      tile_index_[tile.row / kTileSide * wide + tile.column / kTileSide] = -1;
    }
  }
  tiles_.clear();
  outside_.clear();
  calibration_.begin_pass();
  double farthest = 0.0;
  for (LinkState& link : links_) {
    link.X_LS = link.X_FL.inverse() * X_FS;
    const Eigen::Vector3d center_S = link.X_LS.inverse() * link.tree->center();
    farthest = std::max(farthest, center_S.norm());
    link.tolerance = kPose * calibration_.uncertainty(center_S) + config_.model_error +
                     link.speed * config_.time_error;
    const double sigma = config_.noise.sigma(center_S.norm());
    link.blind_skin =
        std::min(padding_, link.tolerance + kCertain * sigma / static_cast<double>(kTileSide));
    link.in_skin = link.unexplained = 0;
  }
  skin_ = padding_;
  if (first_passes_ > 0 && first_passes_ <= kWidePasses) {
    const double largest_error = kPose * calibration_.stated_error(farthest);
    skin_ = std::max(padding_, largest_error * first_passes_ / kWidePasses);
  }
  return skin_;
}

void ViewFilter::add_tile(std::size_t row, std::size_t column, std::uint32_t kept,
                          const SelfFilter& filter, SelfFilter::Verdict verdict,
                          const Eigen::Isometry3d& X_OS) {
  view_.read(*cloud_, row, column, kept);
  if ((kept & 3U) == 3U) pixel_ = view_.direction(0).cross(view_.direction(1)).norm();
  view_.begin(skin_ + kCertain * config_.noise.sigma(view_.farthest()));
  const std::vector<const SelfFilter::Link*>& near_links = filter.near_links();
  const SelfFilter::Link* const likely = near_links.empty() ? nullptr : near_links.back();
  if (likely != nullptr) view_.add_link(*likely, links_[likely->number].X_LS);
  for (const SelfFilter::Link* link : filter.group()) {
    if (link != likely) view_.add_link(*link, links_[link->number].X_LS);
  }
  Tile tile;
  tile.kept = static_cast<std::uint16_t>(kept);
  tile.row = static_cast<std::uint32_t>(row);
  tile.column = static_cast<std::uint32_t>(column);
  tile.height.fill(std::numeric_limits<float>::quiet_NaN());
  for (std::size_t k = 0; k < kPixels; ++k) tile.range[k] = static_cast<float>(view_.range(k));
  constexpr std::uint32_t kWhole = (1U << kPixels) - 1U;
  const bool is_patch = kept == kWhole && add_patch(&tile);
  if (!is_patch) view_.look_at(kept);
  for (std::size_t k = 0; !is_patch && k < kPixels; ++k) {
    if (view_.is_kept(k)) add_pixel(k, {filter, verdict, X_OS}, &tile);
  }
  if (tile.skin != kept) {
    for (std::size_t k = 0; k < kPixels; ++k) {
      if (((kept & ~static_cast<std::uint32_t>(tile.skin)) >> k & 1U) == 0) continue;
      add_outside(X_FS_ * view_.p_S(k));
      break;  // one place a tile is enough
    }
  }
  tile_index_[row / kTileSide * tiles_wide_ + column / kTileSide] =
      static_cast<std::int32_t>(tiles_.size());
  tiles_.push_back(tile);
}

std::uint64_t ViewFilter::voxel(const Eigen::Vector3d& p_F, int dx, int dy, int dz) const {
  // 21 bits for each axis: far more than the reach of a robot, about the sensor's neighbourhood.
  const auto part = [](double x, int shift) {
    return (static_cast<std::uint64_t>(static_cast<std::int64_t>(std::floor(x / kVoxel)) + shift)) &
           0x1FFFFFU;
  };
  return part(p_F.x(), dx) << 42U | part(p_F.y(), dy) << 21U | part(p_F.z(), dz);
}

void ViewFilter::add_outside(const Eigen::Vector3d& p_F) {
  outside_.push_back(voxel(p_F, 0, 0, 0));
}

ViewFilter::Tile* ViewFilter::tile_at(std::int64_t row, std::int64_t column) {
  if (row < 0 || column < 0 || row >= static_cast<std::int64_t>(tiles_high_) ||
      column >= static_cast<std::int64_t>(tiles_wide_)) {
    return nullptr;
  }
  const std::int32_t index =
      tile_index_[static_cast<std::size_t>(row) * tiles_wide_ + static_cast<std::size_t>(column)];
  return index < 0 ? nullptr : &tiles_[static_cast<std::size_t>(index)];
}

const ViewFilter::Tile* ViewFilter::tile_at(std::int64_t row, std::int64_t column) const {
  return const_cast<ViewFilter*>(this)->tile_at(row, column);  // NOLINT: the same, without a change
}

void ViewFilter::finish(Tile* tile) {
  tile->robot &= static_cast<std::uint16_t>(~tile->obstacle);
  if (tile->obstacle != 0) add_outside(X_FS_ * tile->p_S.cast<double>());
  if (tile->link != nullptr) {
    LinkState& link = links_[tile->link->number];
    link.in_skin += static_cast<std::uint32_t>(std::bitset<16>(tile->skin).count());
    link.unexplained += static_cast<std::uint32_t>(std::bitset<16>(tile->obstacle).count());
  }
  // Pixels that are only continued from their neighbours count for the sensor's pose. Otherwise a
  // wrong pose, which puts parts of the robot in front of itself, would never be corrected.
  if (!tile->is_patch || tile->certain != 0) return;
  const double noise = std::sqrt(static_cast<double>(tile->variance)) / kPixels;
  calibration_.add(tile->p_S.cast<double>(), tile->n_S.cast<double>(),
                   static_cast<double>(tile->sum) / kPixels,
                   std::hypot(noise, std::max(config_.model_error, kFlat)));
}

bool ViewFilter::end_pass() {
  find_obstacles();
  for (Tile& tile : tiles_) finish(&tile);
  std::sort(outside_.begin(), outside_.end());
  if (first_passes_ == 0) return calibration_.end_pass();
  if (first_passes_ > kWidePasses) {
    calibration_.end_count();
    --first_passes_;
  } else {
    first_passes_ = calibration_.end_wide_pass() ? first_passes_ - 1 : 0;
  }
  return true;
}

const std::uint16_t* ViewFilter::robot_mask(std::size_t row, std::size_t column) const {
  const std::int32_t index = tile_index_[row / kTileSide * tiles_wide_ + column / kTileSide];
  return index < 0 ? nullptr : &tiles_[static_cast<std::size_t>(index)].robot;
}

void ViewFilter::report(ViewReport* report) const {
  report->is_used = true;
  calibration_.report(report);
  report->links.clear();
  for (std::size_t i = 0; i < links_.size(); ++i) {
    if (links_[i].in_skin == 0) continue;
    report->links.push_back({static_cast<std::uint32_t>(i), links_[i].blind_skin, links_[i].in_skin,
                             links_[i].unexplained});
  }
}

}  // namespace ist
