#include "geometry/open_edge_blocks.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "internal/geometry/boundary_edges.h"

namespace ist {
namespace {

constexpr double kFourPi = 12.566370614359172;
// Float loses less than this share of a length that it holds.
constexpr double kRounding = 5e-7;
constexpr int kBisections = 6;

struct Edge {
  Eigen::Vector3d from, to;  // [m]
  double count;
};

OpenEdgeBlock make_block(const Edge* edges, std::size_t size) {
  constexpr float kFarAway = 1e6F;  // [m]
  OpenEdgeBlock block{};
  Eigen::AlignedBox3d box;
  Eigen::Vector3d sum_along = Eigen::Vector3d::Zero();
  double sum_length = 0.0;
  for (std::size_t i = 0; i < OpenEdgeBlock::kEdges; ++i) {
    for (auto& row : block.from) row[i] = kFarAway;
    if (i >= size) continue;
    const Edge& edge = edges[i];
    const Eigen::Vector3d along = edge.to - edge.from;
    for (int axis = 0; axis < 3; ++axis) {
      block.from[axis][i] = static_cast<float>(edge.from[axis]);
      block.along[axis][i] = static_cast<float>(along[axis]);
    }
    block.per_length_sq[i] = static_cast<float>(1.0 / std::max(along.squaredNorm(), 1e-30));
    block.length[i] = static_cast<float>((1.0 + kRounding) * edge.count * along.norm());
    block.count[i] = static_cast<float>(edge.count);
    sum_along += edge.count * along;
    sum_length += edge.count * along.norm();
    box.extend(edge.from).extend(edge.to);
  }
  const Eigen::Vector3d center = box.center();
  for (int axis = 0; axis < 3; ++axis) {
    block.center[axis] = static_cast<float>(center[axis]);
    block.sum_along[axis] = static_cast<float>(sum_along[axis]);
  }
  block.radius =
      static_cast<float>((1.0 + kRounding) * 0.5 * box.sizes().norm() + kRounding * center.norm());
  block.sum_length = static_cast<float>((1.0 + kRounding) * sum_length);
  return block;
}

}  // namespace

OpenEdgeBlocks::OpenEdgeBlocks(const TriangleMesh& mesh, const CancelRequest& cancelled) {
  std::vector<Edge> edges;
  Eigen::AlignedBox3d box;
  for (const OpenEdge& edge : open_edges(mesh, cancelled)) {
    const Eigen::Vector3d &from = mesh.vertices[edge.from], &to = mesh.vertices[edge.to];
    edges.push_back({from, to, static_cast<double>(edge.count)});
    box.extend(from).extend(to);
  }
  throw_if(cancelled);
  if (edges.empty()) return;
  origin_ = box.center();
  extent_ = 0.5 * box.sizes().norm();
  for (Edge& edge : edges) {
    edge.from -= origin_;
    edge.to -= origin_;
  }
  for (std::size_t first = 0; first < edges.size(); first += OpenEdgeBlock::kEdges) {
    blocks_.push_back(
        make_block(edges.data() + first, std::min(OpenEdgeBlock::kEdges, edges.size() - first)));
  }
}

// Within r of p_M, each edge is nearer by r. Edges at d have a share of d / (d - r) more field, so
// that the winding number changes by no more than
//   g r + c r^2 / 2 (d / (d - r))^3,
// with the gradient g at p_M, a bound c of its derivative there, and the nearest edge at d.
double OpenEdgeBlocks::steady_radius(const Eigen::Vector3d& p_M, double change,
                                     double max_radius) const {
  if (!(change > 0.0) || !(max_radius > 0.0)) return 0.0;
  const Eigen::Vector3d local = p_M - origin_;
  const double rounding = kRounding * (local.norm() + extent_);  // [m]
  float p[3];
  for (int axis = 0; axis < 3; ++axis) p[axis] = static_cast<float>(local[axis]);
  OpenEdgeSums sums;
  sum_open_edges(blocks_, p, &sums);
  const double nearest = sums.nearest - rounding;
  const double curvature = sums.curvature / kFourPi * std::pow(sums.nearest / nearest, 3);
  const double field = Eigen::Vector3d(sums.field[0], sums.field[1], sums.field[2]).norm();
  const double gradient = (field + sums.field_error) / kFourPi + rounding * curvature;
  const auto is_steady = [&](double radius) {
    const double nearer = nearest / (nearest - radius);
    return radius < nearest &&
           gradient * radius + 0.5 * curvature * nearer * nearer * nearer * radius * radius <
               (1.0 - 1e-9) * change;
  };
  if (!(nearest > 0.0)) return 0.0;
  if (is_steady(max_radius)) return max_radius;
  double steady = 0.0, step = std::min(max_radius, nearest);
  for (int i = 0; i < kBisections; ++i) {
    step *= 0.5;
    if (is_steady(steady + step)) steady += step;
  }
  return steady;
}

}  // namespace ist
