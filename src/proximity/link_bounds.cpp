// Bounds by a link's tree, and what bounds by its field have in common with them.

#include "proximity/link_bounds.h"

#include <algorithm>
#include <cmath>

#include "internal/geometry/float_rounding.h"
#include "proximity/field_bounds.h"

namespace ist {
namespace {

// Bounding spheres that are no larger than this share of a box count as whole.
constexpr double kCoarse = 0.5;

}  // namespace

void LinkBounds::place_box(const float* min, const float* max, Entry* box) const {
  float square = 0.0F;
  for (int i = 0; i < 3; ++i) {
    box->min[i] = min[i];
    box->max[i] = max[i];
    const float half = 0.5F * (max[i] - min[i]);
    square += half * half;
  }
  box->radius = std::sqrt(square);
  for (int row = 0; row < 3; ++row) {
    box->center[row] = link_.p_LO[row];
    for (int i = 0; i < 3; ++i) {
      box->center[row] += link_.R_LO[3 * row + i] * (0.5F * (min[i] + max[i]));
    }
  }
}

float LinkBounds::height(const Entry& box) const {
  float height = -link_.height;
  for (int i = 0; i < 3; ++i) {
    height += link_.normal[i] * (link_.normal[i] > 0.0F ? box.min[i] : box.max[i]);
  }
  return height;
}

// They say little where the link is nearer than the box is large.
bool LinkBounds::has_corners(const Entry& box, float bound) const {
  return link_.field != nullptr && bound > 0.5F * box.radius;
}

void LinkBounds::bound_corners(const Entry& box, Corners* corners) const {
  bound_corners_by_field(link_, box, corners);
}

float LinkBounds::bound_boxes(const BoxRows& boxes, const Entry& parent, const Corners* corners,
                              float enough, Bounds* bounds) const {
  if (are_beyond_sphere(boxes, enough, bounds)) return kFarAway;
  if (link_.field != nullptr) {
    return bound_boxes_by_field(link_, boxes, parent, corners, bounds);
  }
  Entry box{};
  for (int k = 0; k < boxes.count; ++k) {
    const float min[3] = {boxes.min[0][k], boxes.min[1][k], boxes.min[2][k]};
    const float max[3] = {boxes.max[0][k], boxes.max[1][k], boxes.max[2][k]};
    place_box(min, max, &box);
    bounds->x[k] = box.center[0];
    bounds->y[k] = box.center[1];
    bounds->z[k] = box.center[2];
    bounds->radius[k] = box.radius;
    bounds->distance[k] = height(box);
  }
  bound_by_tree(boxes.count, false, enough, bounds);
  return kFarAway;
}

float LinkBounds::bound_points(const PointTile& tile, const Entry& box, float enough,
                               Bounds* bounds) const {
  if (link_.field != nullptr) return bound_points_by_field(link_, tile, box, bounds);
  Entry point{};
  for (int k = 0; k < tile.count; ++k) {
    const float place[3] = {tile.x[k], tile.y[k], tile.z[k]};
    place_box(place, place, &point);
    bounds->x[k] = point.center[0];
    bounds->y[k] = point.center[1];
    bounds->z[k] = point.center[2];
    bounds->distance[k] = height(point);
  }
  bound_by_tree(tile.count, true, enough, bounds);
  return kFarAway;
}

// Bounds boxes by the link's root sphere, if that is enough for all of them.
bool LinkBounds::are_beyond_sphere(const BoxRows& boxes, float enough, Bounds* bounds) const {
  if (link_.radius == std::numeric_limits<float>::infinity()) return false;
  for (int k = 0; k < kBoxWidth; ++k) {
    float square = 0.0F;
    for (int i = 0; i < 3; ++i) {
      const float below = boxes.min[i][k] - link_.center[i];
      const float above = link_.center[i] - boxes.max[i][k];
      const float beyond = std::max(std::max(below, above), 0.0F);
      square += beyond * beyond;
    }
    bounds->distance[k] = std::sqrt(square) - link_.radius;
  }
  // Written so that a bound of NaN is not enough.
  if (!std::all_of(bounds->distance, bounds->distance + boxes.count,
                   [&](float bound) { return bound >= enough; })) {
    return false;
  }
  std::copy_n(bounds->distance, kBoxWidth, bounds->outside);
  std::copy_n(bounds->distance, kBoxWidth, bounds->surface);
  return true;
}

// Cover spheres hold the surface, and nothing inside is farther from them than the interior gap.
// Heights above the supporting plane are in `distance`.
void LinkBounds::bound_by_tree(int count, bool are_points, float enough, Bounds* bounds) const {
  const InnerSphereTree& tree = *link_.tree;
  const float gap = round_up(tree.interior_gap()) + link_.rounding;
  for (int k = 0; k < count; ++k) {
    const float radius = are_points ? 0.0F : bounds->radius[k];
    const float by_plane = bounds->distance[k];
    if (are_points) bounds->radius[k] = kFarAway;
    if (link_.is_closed && by_plane > 0.0F && by_plane >= enough) {
      bounds->outside[k] = bounds->surface[k] = by_plane;
      continue;
    }
    const Eigen::Vector3d p_LC(bounds->x[k], bounds->y[k], bounds->z[k]);
    const float cover =
        round_down(tree.cover_distance(p_LC, -1e30, are_points ? 0.0 : kCoarse * radius));
    const float by_center = cover - radius, at_center = cover - gap;
    float outside = at_center - radius, lowest = kMayBeInside;
    if (link_.is_closed) {
      if (at_center > 0.0F) outside = std::max(outside, by_center);
      outside = std::max(outside, by_plane);
      // A way out of the root sphere, or up to the plane, leads out of a closed link.
      const double out = (p_LC - tree.center()).norm() - tree.radius();
      lowest = std::max(by_plane, round_down(out) - radius);
      if (at_center > 0.0F) lowest = std::max(lowest, outside);
    }
    bounds->distance[k] =
        outside > 0.0F ? std::max(std::max(outside, by_plane), by_center) : lowest;
    bounds->outside[k] = outside;
    bounds->surface[k] = by_center;
  }
}

}  // namespace ist
