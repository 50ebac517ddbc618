#include "geometry/open_edge_hierarchy.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <utility>

namespace ist {
namespace {

using Edge = OpenEdgeHierarchy::Edge;

constexpr double kFourPi = 12.566370614359172;
// Float loses less than this share of a length that it holds.
constexpr double kEdgeRounding = 5e-7;
// A steady radius is looked for down to a share of 2^-kHalvings of the largest, and to this share
// of itself.
constexpr int kHalvings = 12;
constexpr double kResolution = 0.05;
constexpr float kFarAway = 1e6F;  // [m]

std::vector<Edge> edges_of(const TriangleMesh& mesh, const std::vector<OpenEdge>& open) {
  std::vector<Edge> edges;
  edges.reserve(open.size());
  for (const OpenEdge& edge : open) {
    edges.push_back(
        {mesh.vertices[edge.from], mesh.vertices[edge.to], static_cast<double>(edge.count)});
  }
  return edges;
}

// Orders edges so that those of a block lie together, and those of a node: space is divided at
// medians across the longest side, at multiples of what a node's child holds.
void arrange(Edge* first, Edge* last, const CancelRequest& cancelled) {
  constexpr auto kBlock = static_cast<std::ptrdiff_t>(OpenEdgeBlock::kEdges);
  constexpr auto kWidth = static_cast<std::ptrdiff_t>(OpenEdgeNode::kChildren);
  while (last - first > kBlock) {
    throw_if(cancelled);
    const std::ptrdiff_t count = last - first;
    std::ptrdiff_t unit = kBlock;
    while (unit * kWidth < count) unit *= kWidth;
    Edge* const half = first + std::max<std::ptrdiff_t>((count / 2 + unit / 2) / unit, 1) * unit;
    Eigen::AlignedBox3d middles;
    for (const Edge* edge = first; edge != last; ++edge) middles.extend(edge->from + edge->to);
    Eigen::Index axis;
    middles.sizes().maxCoeff(&axis);
    std::nth_element(first, half, last, [axis](const Edge& a, const Edge& b) {
      return (a.from + a.to)[axis] < (b.from + b.to)[axis];
    });
    arrange(first, half, cancelled);
    first = half;
  }
}

OpenEdgeBlock make_block(const Edge* edges, std::size_t size) {
  OpenEdgeBlock block{};
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
    block.length[i] = static_cast<float>((1.0 + kEdgeRounding) * edge.count * along.norm());
    block.count[i] = static_cast<float>(edge.count);
  }
  return block;
}

// A child of a node, as that sees it.
struct Cluster {
  Eigen::AlignedBox3d box;  // [m] of the edges
  Eigen::Vector3d center;   // [m]
  double radius = 0.0;      // [m]
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  Eigen::Matrix3d moment = Eigen::Matrix3d::Zero();
  double length = 0.0;  // [m]
  std::int32_t child = 0;
};

Cluster cluster_of(const Edge* edges, std::size_t size, std::int32_t child) {
  Cluster cluster;
  for (std::size_t i = 0; i < size; ++i) cluster.box.extend(edges[i].from).extend(edges[i].to);
  cluster.center = cluster.box.center();
  cluster.radius = 0.5 * cluster.box.sizes().norm();
  cluster.child = child;
  for (std::size_t i = 0; i < size; ++i) {
    const Eigen::Vector3d along = edges[i].count * (edges[i].to - edges[i].from);
    const Eigen::Vector3d middle = 0.5 * (edges[i].from + edges[i].to);
    cluster.sum += along;
    cluster.moment += (middle - cluster.center) * along.transpose();
    cluster.length += along.norm();
  }
  return cluster;
}

Cluster cluster_of(const Cluster* parts, std::size_t size, std::int32_t child) {
  Cluster cluster;
  for (std::size_t i = 0; i < size; ++i) cluster.box.extend(parts[i].box);
  cluster.center = cluster.box.center();
  cluster.child = child;
  for (std::size_t i = 0; i < size; ++i) {
    const Eigen::Vector3d offset = parts[i].center - cluster.center;
    cluster.radius = std::max(cluster.radius, offset.norm() + parts[i].radius);
    cluster.sum += parts[i].sum;
    cluster.moment += parts[i].moment + offset * parts[i].sum.transpose();
    cluster.length += parts[i].length;
  }
  cluster.radius = std::min(cluster.radius, 0.5 * cluster.box.sizes().norm());
  return cluster;
}

OpenEdgeNode make_node(const Cluster* clusters, std::size_t size) {
  OpenEdgeNode node{};
  for (std::size_t k = 0; k < OpenEdgeNode::kChildren; ++k) {
    for (auto& row : node.center) row[k] = kFarAway;
    if (k >= size) continue;
    const Cluster& cluster = clusters[k];
    for (int i = 0; i < 3; ++i) {
      node.center[i][k] = static_cast<float>(cluster.center[i]);
      node.sum[i][k] = static_cast<float>(cluster.sum[i]);
      for (int j = 0; j < 3; ++j) {
        node.moment[i][j][k] = static_cast<float>(cluster.moment(i, j));
      }
    }
    node.radius[k] = static_cast<float>((1.0 + kEdgeRounding) * cluster.radius +
                                        kEdgeRounding * cluster.center.norm());
    node.length[k] = static_cast<float>((1.0 + kEdgeRounding) * cluster.length);
    node.child[k] = cluster.child;
  }
  return node;
}

}  // namespace

OpenEdgeHierarchy::OpenEdgeHierarchy(const TriangleMesh& mesh, const CancelRequest& cancelled)
    : OpenEdgeHierarchy(mesh, open_edges(mesh, cancelled), cancelled) {}

OpenEdgeHierarchy::OpenEdgeHierarchy(const TriangleMesh& mesh, const std::vector<OpenEdge>& open,
                                     const CancelRequest& cancelled)
    : OpenEdgeHierarchy(edges_of(mesh, open), cancelled) {}

OpenEdgeHierarchy::OpenEdgeHierarchy(std::vector<Edge> edges, const CancelRequest& cancelled) {
  throw_if(cancelled);
  if (edges.empty()) return;
  Eigen::AlignedBox3d box;
  for (const Edge& edge : edges) box.extend(edge.from).extend(edge.to);
  origin_ = box.center();
  extent_ = 0.5 * box.sizes().norm();
  for (Edge& edge : edges) {
    edge.from -= origin_;
    edge.to -= origin_;
  }
  arrange(edges.data(), edges.data() + edges.size(), cancelled);
  std::vector<Cluster> clusters, parents;
  for (std::size_t i = 0; i < edges.size(); i += OpenEdgeBlock::kEdges) {
    const std::size_t size = std::min(OpenEdgeBlock::kEdges, edges.size() - i);
    clusters.push_back(cluster_of(&edges[i], size, ~static_cast<std::int32_t>(blocks_.size())));
    blocks_.push_back(make_block(&edges[i], size));
  }
  do {
    parents.clear();
    for (std::size_t i = 0; i < clusters.size(); i += OpenEdgeNode::kChildren) {
      const std::size_t size = std::min(OpenEdgeNode::kChildren, clusters.size() - i);
      parents.push_back(cluster_of(&clusters[i], size, static_cast<std::int32_t>(nodes_.size())));
      nodes_.push_back(make_node(&clusters[i], size));
    }
    clusters.swap(parents);
  } while (clusters.size() > 1);
}

double OpenEdgeHierarchy::rounding(const Eigen::Vector3d& p_M) const {
  return kEdgeRounding * ((p_M - origin_).norm() + extent_);
}

OpenEdgeSums OpenEdgeHierarchy::sums(const Eigen::Vector3d& p_M) const {
  OpenEdgeSums sums;
  if (nodes_.empty()) return sums;
  const Eigen::Vector3f local = (p_M - origin_).cast<float>();
  sum_open_edges(nodes_, blocks_, local.data(), &sums);
  return sums;
}

// Within r of p_M, each edge is nearer by r. Edges at d have a share of d / (d - r) more field, so
// that the winding number changes by no more than
//   g r + c r^2 / 2 (d / (d - r))^3,
// with the gradient g at p_M, a bound c of its derivative there, and the nearest edge at d.
double OpenEdgeHierarchy::steady_radius(const Eigen::Vector3d& p_M, double change,
                                        double max_radius) const {
  if (!(change > 0.0) || !(max_radius > 0.0)) return 0.0;
  if (nodes_.empty()) return max_radius;
  const double rounding = this->rounding(p_M);
  const OpenEdgeSums sums = this->sums(p_M);
  const double nearest = sums.nearest - rounding;
  if (!(nearest > 0.0)) return 0.0;
  const double farther = sums.nearest / nearest;
  const double curvature = sums.curvature / kFourPi * farther * farther * farther;
  const double field = Eigen::Vector3d(sums.field[0], sums.field[1], sums.field[2]).norm();
  const double gradient = (field + sums.field_error) / kFourPi + rounding * curvature;
  const auto is_steady = [&](double radius) {
    if (!(radius < nearest)) return false;
    const double nearer = nearest / (nearest - radius);
    return gradient * radius + 0.5 * curvature * nearer * nearer * nearer * radius * radius <
           (1.0 - 1e-9) * change;
  };
  if (is_steady(max_radius)) return max_radius;
  double steady = std::min(max_radius, nearest);
  for (int i = 0; i < kHalvings && !is_steady(steady); ++i) steady *= 0.5;
  if (!is_steady(steady)) return 0.0;
  for (double step = 0.5 * steady; step > kResolution * steady; step *= 0.5) {
    if (is_steady(steady + step)) steady += step;
  }
  return steady;
}

}  // namespace ist
