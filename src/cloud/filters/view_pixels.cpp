// This part of ViewFilter looks at one tile and decides what its pixels show.

#include <algorithm>
#include <array>
#include <cmath>

#include "cloud/filters/view_filter.h"
#include "internal/geometry/numbers.h"
#include "internal/geometry/ray_cast.h"
#include "internal/geometry/solid_queries.h"

namespace ist {
namespace {

// Noise never pulls a mean back by more: a mixed pixel or a shadow is no evidence of free space.
constexpr double kClipped = 3.0;
constexpr double kGrazing = 0.15;  // cosine: below it, a patch is looked at pixel by pixel

double angle_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::sqrt(std::max(2.0 - 2.0 * a.dot(b), 0.0));
}

// Whether the spheres of a link prove that its surface is farther from a point than `limit` [m].
bool is_farther(const SelfFilter::Link& link, const Eigen::Vector3d& p_L, double limit) {
  return link.tree->cover_distance_exceeds(p_L, std::max(limit, link.tree->interior_gap()));
}

// [m] The distance of a point to the surface of a link; inf where it is more than `limit`.
double distance_within(const SelfFilter::Link& link, const Eigen::Vector3d& p_L, double limit) {
  return is_farther(link, p_L, limit) ? kInfinity
                                      : distance_outside(*link.solid, p_L, limit).distance;
}

// [m] The nearest approach of a ray to the surface of a link near its point at t, where that is
// within `limit` [m] and the ray comes nearest before `last`; else inf.
double approach_within(const SelfFilter::Link& link, const Eigen::Vector3d& o_L,
                       const Eigen::Vector3d& d_L, double t, double last, double limit) {
  if (is_farther(link, o_L + t * d_L, limit)) return kInfinity;
  const RayApproach near = nearest_approach(*link.solid, o_L, d_L, t, limit);
  return near.t <= last ? near.distance : kInfinity;
}

}  // namespace

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
    return SelfFilter::is_on_link(*link, p_O);
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

}  // namespace ist
