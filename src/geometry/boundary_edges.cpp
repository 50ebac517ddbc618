#include "geometry/boundary_edges.h"

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <map>
#include <tuple>
#include <utility>
#include <vector>

namespace ist {

std::size_t count_boundary_edges(const TriangleMesh& mesh) {
  using Key = std::tuple<double, double, double>;
  std::map<Key, std::uint32_t> unique;
  std::vector<std::uint32_t> id(mesh.vertices.size());
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    const Eigen::Vector3d& p = mesh.vertices[v];
    id[v] = unique.emplace(Key(p.x(), p.y(), p.z()), static_cast<std::uint32_t>(unique.size()))
                .first->second;
  }
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> balance;  // forward minus backward
  for (const TriangleMesh::Triangle& t : mesh.triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = id[t[k]], b = id[t[(k + 1) % 3]];
      if (a != b) balance[{std::min(a, b), std::max(a, b)}] += a < b ? 1 : -1;
    }
  }
  std::size_t open = 0;
  for (const auto& edge : balance) open += static_cast<std::size_t>(std::abs(edge.second));
  return open;
}

bool is_closed_mesh(const TriangleMesh& mesh) { return count_boundary_edges(mesh) == 0; }

}  // namespace ist
