#include "internal/geometry/outside_margin.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "geometry/open_edge_blocks.h"
#include "geometry/solid_element.h"
#include "internal/geometry/boundary_edges.h"

namespace ist {
namespace {

constexpr double kFourPi = 12.566370614359172;
// [m] Larger margins are not looked for: the gradient's bound grows with them.
constexpr double kLargestMargin = 0.01;
// A block is opened where its edges may be nearer than so many of its radii.
constexpr double kFarBlock = 2.0;
// A place below this winding number is outside in spite of the errors of winding numbers, which are
// 0.01, and 0.06 for the quick one.
constexpr double kSurelyOutside = 0.47;

double distance_to_edge(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                        const Eigen::Vector3d& b) {
  const Eigen::Vector3d ab = b - a;
  const double along = std::clamp(ab.dot(p - a) / ab.squaredNorm(), 0.0, 1.0);
  return (a + along * ab - p).norm();
}

}  // namespace

OpenEdgeBlocks::OpenEdgeBlocks(const TriangleMesh& mesh, const CancelRequest& cancelled) {
  for (const OpenEdge& edge : open_edges(mesh, cancelled)) {
    const Eigen::Vector3d &from = mesh.vertices[edge.from], &to = mesh.vertices[edge.to];
    edges_.push_back({from, to, edge.count * (to - from).norm()});
  }
  throw_if(cancelled);
  for (std::size_t first = 0; first < edges_.size(); first += kEdges) {
    Block block{Eigen::Vector3d::Zero(), 0.0, 0.0, first, std::min(first + kEdges, edges_.size())};
    Eigen::AlignedBox3d box;
    for (std::size_t i = block.first; i < block.last; ++i) {
      box.extend(edges_[i].from).extend(edges_[i].to);
      block.length += edges_[i].length;
    }
    block.center = box.center();
    block.radius = 0.5 * box.sizes().norm() * (1.0 + 1e-12);
    blocks_.push_back(block);
  }
}

double OpenEdgeBlocks::gradient_bound(const Eigen::Vector3d& p_M, double radius) const {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  double sum = 0.0;
  for (const Block& block : blocks_) {
    const double distance = (p_M - block.center).norm() - block.radius - radius;
    if (distance > kFarBlock * block.radius) {
      sum += block.length / (distance * distance);
      continue;
    }
    for (std::size_t i = block.first; i < block.last; ++i) {
      const Edge& edge = edges_[i];
      const double to_edge = distance_to_edge(p_M, edge.from, edge.to) - radius;
      if (!(to_edge > 0.0)) return kInfinity;
      sum += edge.length / (to_edge * to_edge);
    }
  }
  return sum * (1.0 + 1e-9) / kFourPi;
}

OutsideMargin outside_margin(const Solid& solid, const Eigen::Vector3d& p_L,
                             double surface_distance) {
  const SolidElement& element = elements_of(solid).front();
  const Eigen::Vector3d p_E = element.X_EL * p_L;
  const double quick = element.bvh.quick_winding_number(p_E);
  OutsideMargin result;
  if (std::abs(quick - 0.5) > TriangleBvh::kQuickWindingError) {
    result.is_inside = element.bvh.bounds().contains(p_E) && quick > 0.5;
  } else {
    result.is_inside = element.is_inside(p_E);
  }
  const double slack = kSurelyOutside - (quick + TriangleBvh::kQuickWindingError);
  if (result.is_inside || !(slack > 0.0) || !(surface_distance > 0.0)) return result;
  const double radius = std::min((1.0 - 1e-9) * surface_distance, kLargestMargin);
  const double gradient = element.open_edges.gradient_bound(p_E, radius);
  result.margin = std::min(radius, (1.0 - 1e-9) * slack / std::max(gradient, 1e-300));
  return result;
}

}  // namespace ist
