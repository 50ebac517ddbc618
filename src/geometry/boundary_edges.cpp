#include "internal/geometry/boundary_edges.h"

#include <algorithm>
#include <cstdint>
#include <functional>
#include <numeric>
#include <utility>
#include <vector>

namespace ist {
namespace {

// Sorts, and asks now and then whether to go on: a million triangles have three million edges.
template <typename T, typename Less>
void sort(const Less& less, const CancelRequest& cancelled, std::vector<T>* values) {
  constexpr std::uint32_t kAskEvery = 1U << 18U;  // comparisons: some milliseconds
  std::uint32_t comparisons = 0;
  throw_if(cancelled);
  std::sort(values->begin(), values->end(), [&](const T& a, const T& b) {
    if (++comparisons % kAskEvery == 0) throw_if(cancelled);
    return less(a, b);
  });
}

// Maps each vertex to the first vertex at the same place.
std::vector<std::uint32_t> representatives(const std::vector<Eigen::Vector3d>& vertices,
                                           const CancelRequest& cancelled) {
  std::vector<std::uint32_t> order(vertices.size());
  std::iota(order.begin(), order.end(), 0U);
  const auto less = [&](std::uint32_t i, std::uint32_t j) {
    const Eigen::Vector3d &a = vertices[i], &b = vertices[j];
    return std::lexicographical_compare(a.data(), a.data() + 3, b.data(), b.data() + 3);
  };
  sort(less, cancelled, &order);
  std::vector<std::uint32_t> id(vertices.size());
  for (std::size_t k = 0; k < order.size(); ++k) {
    const bool is_new = k == 0 || less(order[k - 1], order[k]);
    id[order[k]] = is_new ? order[k] : id[order[k - 1]];
  }
  return id;
}

}  // namespace

std::vector<OpenEdge> open_edges(const TriangleMesh& mesh, const CancelRequest& cancelled) {
  const std::vector<std::uint32_t> id = representatives(mesh.vertices, cancelled);
  // Each edge as a pair of vertices, low in the upper half, and its direction: 1 or -1.
  std::vector<std::pair<std::uint64_t, int>> edges;
  edges.reserve(3 * mesh.triangles.size());
  for (const TriangleMesh::Triangle& t : mesh.triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint64_t a = id[t[k]], b = id[t[(k + 1) % 3]];
      if (a != b) edges.emplace_back(std::min(a, b) << 32U | std::max(a, b), a < b ? 1 : -1);
    }
  }
  sort(std::less<>(), cancelled, &edges);
  std::vector<OpenEdge> open;
  for (std::size_t first = 0; first < edges.size();) {
    std::size_t last = first;
    int balance = 0;
    while (last < edges.size() && edges[last].first == edges[first].first) {
      balance += edges[last++].second;
    }
    const auto low = static_cast<std::uint32_t>(edges[first].first >> 32U);
    const auto high = static_cast<std::uint32_t>(edges[first].first);
    if (balance > 0) open.push_back({low, high, balance});
    if (balance < 0) open.push_back({high, low, -balance});
    first = last;
  }
  return open;
}

std::size_t count_boundary_edges(const TriangleMesh& mesh) {
  std::size_t count = 0;
  for (const OpenEdge& edge : open_edges(mesh)) count += static_cast<std::size_t>(edge.count);
  return count;
}

bool is_closed_mesh(const TriangleMesh& mesh, const CancelRequest& cancelled) {
  return open_edges(mesh, cancelled).empty();
}

}  // namespace ist
