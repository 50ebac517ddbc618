#include "ros/input/unseen_markers.h"

#include <visualization_msgs/Marker.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <map>
#include <vector>

#include "ros/common/eigen_conversion.h"

namespace ist {
namespace {

using visualization_msgs::Marker;

constexpr std::size_t kMaxCubes = 20000;
constexpr double kLargestCube = 0.05;  // [m] Larger boxes are drawn in parts.
constexpr double kDrawnShare = 0.25;   // of a cube's edges, so that the robot is seen through them
constexpr double kSizeStep = 1e-4;     // [m] Cubes whose sizes differ by less are one list.
constexpr double kGrey = 0.6;
constexpr double kOpacity = 0.8;  // of what touches a link; nothing is left at the range's end

std_msgs::ColorRGBA grey(double opacity) {
  std_msgs::ColorRGBA color;
  color.r = color.g = color.b = static_cast<float>(kGrey);
  color.a = static_cast<float>(opacity);
  return color;
}

struct Cube {
  Eigen::AlignedBox3d box;
  double distance;  ///< [m] to the nearest link's box
};

double distance_to(const VoxelBoxes& links, const Eigen::AlignedBox3d& box) {
  double smallest = std::numeric_limits<double>::infinity();
  for (const Eigen::AlignedBox3d& link : links) {
    smallest = std::min(smallest, link.exteriorDistance(box));
  }
  return smallest;
}

/// Halves a box along its longest side until its parts are small or far.
void append_parts(const Eigen::AlignedBox3d& box, const VoxelBoxes& links, double range,
                  std::vector<Cube>* cubes) {
  const double distance = distance_to(links, box);
  if (!(distance < range)) return;
  int side = 0;
  if (box.sizes().maxCoeff(&side) <= kLargestCube) {
    cubes->push_back({box, distance});
    return;
  }
  Eigen::AlignedBox3d low = box, high = box;
  low.max()[side] = high.min()[side] = box.center()[side];
  append_parts(low, links, range, cubes);
  append_parts(high, links, range, cubes);
}

void keep_nearest(std::vector<Cube>* cubes) {
  if (cubes->size() <= kMaxCubes) return;
  std::nth_element(cubes->begin(), cubes->begin() + kMaxCubes, cubes->end(),
                   [](const Cube& a, const Cube& b) { return a.distance < b.distance; });
  cubes->resize(kMaxCubes);
}

Marker cube_list(const Eigen::Vector3d& size, const std_msgs::Header& header, int id) {
  Marker marker;
  marker.header = header;
  marker.ns = "unseen";
  marker.id = id;
  marker.type = Marker::CUBE_LIST;
  marker.pose.orientation.w = 1.0;
  assign(kDrawnShare * size, &marker.scale);
  marker.color = grey(kOpacity);
  return marker;
}

}  // namespace

visualization_msgs::MarkerArray unseen_markers(const VoxelBoxes& boxes, const VoxelBoxes& links,
                                               double range, const std_msgs::Header& header) {
  visualization_msgs::MarkerArray array;
  array.markers.emplace_back();
  array.markers.back().header = header;
  array.markers.back().action = Marker::DELETEALL;
  array.markers.back().pose.orientation.w = 1.0;
  std::vector<Cube> cubes;
  for (const Eigen::AlignedBox3d& box : boxes) append_parts(box, links, range, &cubes);
  keep_nearest(&cubes);

  std::map<std::array<long, 3>, std::size_t> lists;  // by size, all cubes of which are one marker
  for (const Cube& cube : cubes) {
    const Eigen::Vector3d size = cube.box.sizes();
    std::array<long, 3> key{};
    for (int k = 0; k < 3; ++k) key[static_cast<std::size_t>(k)] = std::lround(size[k] / kSizeStep);
    const auto [list, is_new] = lists.try_emplace(key, array.markers.size());
    if (is_new) array.markers.push_back(cube_list(size, header, static_cast<int>(lists.size())));
    Marker& marker = array.markers[list->second];
    marker.points.emplace_back();
    assign(cube.box.center(), &marker.points.back());
    const double opacity = kOpacity * (1.0 - cube.distance / range);
    marker.colors.push_back(grey(opacity));
  }
  return array;
}

}  // namespace ist
