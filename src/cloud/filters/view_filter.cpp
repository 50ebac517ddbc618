#include "cloud/filters/view_filter.h"

#include <algorithm>
#include <bitset>
#include <cmath>
#include <limits>

#include "cloud/filters/crop.h"
#include "cloud/format/point_reader.h"
#include "internal/geometry/ray_cast.h"
#include "internal/geometry/solid_queries.h"

namespace ist {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr std::size_t kPixels = kTileSide * kTileSide;
constexpr std::uint32_t kWhole = (1U << kPixels) - 1U;

// Noise never pulls a mean back by more: a mixed pixel or a shadow is no evidence of free space.
constexpr double kClipped = 3.0;
// Standard deviations of the sensor's corrected pose.
constexpr double kPose = 3.0;
// Passes of the first cloud with a larger padding, which falls from pass to pass: where the
// sensor's pose is as wrong as is stated, few of the robot's points are within the padding at
// first.
constexpr int kWidePasses = 3;
constexpr unsigned kSearchEvery = 16;  // clouds, without the robot in view

constexpr double kFlat = 0.0005;       // [m] a patch of surface deviates less from a plane
constexpr double kGrazing = 0.15;      // cosine: below it, a patch is looked at pixel by pixel
constexpr double kUnknownSpeed = 1.0;  // [m/s] of a link that was not there a cloud ago
constexpr double kLongestStep = 0.5;   // [s] between two clouds, for a speed
// [m] Edge of a voxel of what was outside the skin: at 30 Hz what moves at 1 m/s stays a neighbour.
constexpr double kVoxel = 0.04;

double angle_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::sqrt(std::max(2.0 - 2.0 * a.dot(b), 0.0));
}

// The median of the angles [rad] between neighbours, of some samples; inf: too few were measured.
class NeighbourAngles {
 public:
  bool is_full() const { return count_ == values_.size(); }
  void add(const Eigen::Vector3d& p, const Eigen::Vector3d& q) {
    if (is_full() || !p.allFinite() || !q.allFinite()) return;
    const double norms = p.norm() * q.norm();
    if (norms > 0.0) values_[count_++] = p.cross(q).norm() / norms;
  }
  double median() {
    if (count_ < kFewest) return kInf;
    const auto middle = values_.begin() + static_cast<std::ptrdiff_t>(count_ / 2);
    std::nth_element(values_.begin(), middle,
                     values_.begin() + static_cast<std::ptrdiff_t>(count_));
    return *middle;
  }

 private:
  static constexpr std::size_t kFewest = 8;
  std::array<double, 256> values_;
  std::size_t count_ = 0;
};

}  // namespace

bool is_view(const RawCloud& cloud) {
  if (cloud.width < kTileSide || cloud.height < kTileSide) return false;
  if (cloud.depth != DepthType::kNone) return true;
  constexpr std::size_t kSamples = 2048;
  // An odd stride: the samples are to be spread over the columns.
  const std::size_t stride = cloud.size() / kSamples | 1U;
  NeighbourAngles across, down;
  for (std::size_t i = 0; i < cloud.size() && !(across.is_full() && down.is_full()); i += stride) {
    const std::size_t row = i / cloud.width, column = i % cloud.width;
    if (row + 1 == cloud.height || column + 1 == cloud.width) continue;
    const Eigen::Vector3d p = point_at(cloud, row, column);
    across.add(p, point_at(cloud, row, column + 1));
    down.add(p, point_at(cloud, row + 1, column));
  }
  // All around, neighbours would be 2 pi / width and pi / height apart; cameras see less.
  constexpr double kPi = 3.14159265358979323846;
  constexpr double kFewTimes = 2.0;
  return across.median() <= kFewTimes * 2.0 * kPi / static_cast<double>(cloud.width) &&
         down.median() <= kFewTimes * kPi / static_cast<double>(cloud.height);
}

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

void ViewFilter::add_height(std::size_t k, double height, double noise, Tile* tile) const {
  const auto bit = static_cast<std::uint16_t>(1U << k);
  tile->height[k] = static_cast<float>(height);
  tile->skin |= bit;
  tile->robot |= bit;
  const double tolerance = static_cast<double>(tile->tolerance);
  if (height > kCertain * noise + tolerance) tile->obstacle |= bit;
  tile->sum += static_cast<float>(std::max(height, -kClipped * noise - tolerance));
  tile->variance += static_cast<float>(noise * noise);
  ++tile->count;
}

// A tile on a smooth part of one link, as most are: four rays say where its plane is.
bool ViewFilter::add_patch(Tile* tile) {
  constexpr std::array<std::size_t, 4> kCorners = {0, kTileSide - 1, kPixels - kTileSide,
                                                   kPixels - 1};
  std::array<TileView::Sight, 4> sights;
  std::array<Eigen::Vector3d, 4> hits;
  view_.look_at(1U << kCorners[0] | 1U << kCorners[1] | 1U << kCorners[2] | 1U << kCorners[3]);
  for (std::size_t i = 0; i < 4; ++i) {
    sights[i] = view_.sight(kCorners[i]);
    if (sights[i].link == nullptr || sights[i].link != sights[0].link) return false;
    hits[i] = sights[i].t * view_.direction(kCorners[i]);
  }
  const Eigen::Vector3d across = hits[3] - hits[0], down = hits[2] - hits[1];
  Eigen::Vector3d normal = across.cross(down);
  const double size = normal.norm();
  if (!(size > 0.0)) return false;
  const Eigen::Vector3d middle = 0.25 * (hits[0] + hits[1] + hits[2] + hits[3]);
  normal /= normal.dot(middle) < 0.0 ? size : -size;
  const double length = std::max(across.norm(), down.norm());
  const double bend = std::max(angle_between(sights[0].normal, sights[3].normal),
                               angle_between(sights[1].normal, sights[2].normal));
  if (length * bend > 8.0 * kFlat) return false;
  for (const Eigen::Vector3d& hit : hits) {
    if (std::abs(normal.dot(hit - middle)) > kFlat) return false;
  }
  const double cosine = -normal.dot(middle.normalized());
  if (cosine < kGrazing) return false;
  std::array<double, kPixels> heights;
  for (std::size_t k = 0; k < kPixels; ++k) {
    heights[k] = normal.dot(view_.p_S(k) - middle);
    // A point that is farther from the surface along its ray may be outside the skin.
    if (std::abs(heights[k]) > (skin_ - 2.0 * kFlat) * cosine) return false;
  }
  tile->link = sights[0].link;
  tile->tolerance = static_cast<float>(links_[tile->link->number].tolerance);
  const double noise = config_.noise.sigma(middle.norm()) * cosine;
  for (std::size_t k = 0; k < kPixels; ++k) add_height(k, heights[k], noise, tile);
  tile->is_patch = true;
  tile->p_S = (middle + tile->sum / static_cast<double>(kPixels) * normal).cast<float>();
  tile->n_S = normal.cast<float>();
  return true;
}

namespace {

// Whether the spheres of a link prove that its surface is farther from a point than `limit` [m].
bool is_farther(const SelfFilter::Link& link, const Eigen::Vector3d& p_L, double limit) {
  return link.tree->cover_distance_exceeds(p_L, std::max(limit, link.tree->interior_gap()));
}

// [m] The distance of a point to the surface of a link; inf where it is more than `limit`.
double distance_within(const SelfFilter::Link& link, const Eigen::Vector3d& p_L, double limit) {
  return is_farther(link, p_L, limit) ? kInf : distance_outside(*link.solid, p_L, limit).distance;
}

// [m] The nearest approach of a ray to the surface of a link near its point at t, where that is
// within `limit` [m] and the ray comes nearest before `last`; else inf.
double approach_within(const SelfFilter::Link& link, const Eigen::Vector3d& o_L,
                       const Eigen::Vector3d& d_L, double t, double last, double limit) {
  if (is_farther(link, o_L + t * d_L, limit)) return kInf;
  const RayApproach near = nearest_approach(*link.solid, o_L, d_L, t, limit);
  return near.t <= last ? near.distance : kInf;
}

}  // namespace

// Judges a point whose ray passes the links, or meets them far behind it: an obstacle is nowhere
// near a surface, within what noise, the sensor's pose and blurred edges leave open. Behind the
// nearest point of a surface it is a mixed pixel or a shadow.
ViewFilter::Passing ViewFilter::pass(std::size_t k, const SelfFilter& filter) const {
  const double range = view_.range(k);
  const double last = range + kCertain * config_.noise.sigma(range);
  const double blur = config_.mixed_pixels * pixel_ * range;
  Passing passing = Passing::kObstacle;
  for (const SelfFilter::Link* link : filter.group()) {
    const LinkState& state = links_[link->number];
    const Eigen::Vector3d o_L = state.X_LS.translation(),
                          d_L = state.X_LS.linear() * view_.direction(k);
    const double limit = state.tolerance + blur;
    const double behind = distance_within(*link, o_L + last * d_L, limit);
    if (behind <= state.tolerance) return Passing::kRobot;
    const double distance =
        std::min(behind, approach_within(*link, o_L, d_L, range, last, skin_ + kFlat));
    if (distance <= state.tolerance) return Passing::kRobot;
    if (distance <= limit) passing = Passing::kBlurred;
  }
  return passing;
}

// A link that a point is in the skin of; null: none.
const SelfFilter::Link* ViewFilter::skin_of(std::size_t k, const TileView::Sight& sight,
                                            const Skin& skin) const {
  // The surface is no farther than it is along the ray.
  if (std::abs(sight.t - view_.range(k)) <= skin_) return sight.link;
  const std::vector<const SelfFilter::Link*>& links = skin.filter.near_links();
  if (skin.verdict == SelfFilter::Verdict::kOnRobot) return links.back();
  const Eigen::Vector3d p_O = skin.X_OS * view_.p_S(k);
  const auto on = std::find_if(links.begin(), links.end(), [&](const SelfFilter::Link* link) {
    return skin.filter.is_on_link(*link, p_O);
  });
  return on == links.end() ? nullptr : *on;
}

// A pixel of a tile at an edge of the robot, or with obstacles: it has its own ray.
void ViewFilter::add_pixel(std::size_t k, const Skin& skin, Tile* tile) {
  const auto bit = static_cast<std::uint16_t>(1U << k);
  const double range = view_.range(k);
  const TileView::Sight& sight = view_.sight(k);
  const SelfFilter::Link* const in_skin = skin_of(k, sight, skin);
  if (in_skin == nullptr) {
    // Close in front of the robot there is nothing but an obstacle.
    const double limit = skin_ + kFront * config_.noise.sigma(range);
    const double depth = sight.t - range;
    if (sight.link == nullptr || depth <= skin_ || depth >= limit) return;
    tile->front |= bit;
    const double cosine = -sight.normal.dot(view_.direction(k));
    const double noise = config_.noise.sigma(range) * cosine;
    const double tolerance = links_[sight.link->number].tolerance;
    if (depth * cosine <= kCertain * noise + tolerance) tile->stray |= bit;
    return;
  }
  if (tile->link == nullptr) {
    tile->link = sight.link != nullptr ? sight.link : in_skin;
    tile->tolerance = static_cast<float>(links_[tile->link->number].tolerance);
    tile->p_S = view_.p_S(k).cast<float>();
  }
  const bool misses = sight.link == nullptr;
  const double cosine = misses ? 1.0 : -sight.normal.dot(view_.direction(k));
  const double height = (sight.t - range) * cosine, noise = config_.noise.sigma(range) * cosine;
  if (misses || height > kCertain * noise + static_cast<double>(tile->tolerance)) {
    const Passing passing = pass(k, skin.filter);
    if (misses || passing != Passing::kObstacle) {
      // At an edge the ray may meet what is behind it: nothing is known of the height.
      tile->skin |= bit;
      tile->robot |= bit;
      if (passing == Passing::kObstacle) tile->obstacle |= bit;
      if (passing == Passing::kBlurred) tile->blurred |= bit;
      return;
    }
  }
  add_height(k, height, noise, tile);
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
