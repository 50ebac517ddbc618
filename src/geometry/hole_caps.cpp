#include "internal/geometry/hole_caps.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <queue>
#include <unordered_map>

namespace ist {
namespace {

// Vertices in order; an edge leads from each one to the next.
using Loop = std::vector<std::uint32_t>;

// Follows open edges; whenever the path returns to one of its vertices, it closes a loop.
std::vector<Loop> find_loops(const std::vector<OpenEdge>& open, CancelWatch* watch) {
  std::unordered_map<std::uint32_t, std::vector<std::uint32_t>> next;
  for (const OpenEdge& edge : open) {
    watch->step();
    for (int i = 0; i < edge.count; ++i) next[edge.from].push_back(edge.to);
  }
  std::vector<Loop> loops;
  std::unordered_map<std::uint32_t, std::size_t> index_in_path;
  for (const OpenEdge& edge : open) {
    Loop path = {edge.from};
    index_in_path = {{edge.from, 0}};
    for (auto* edges = &next[edge.from]; !edges->empty(); edges = &next[path.back()]) {
      watch->step();
      const std::uint32_t vertex = edges->back();
      edges->pop_back();
      const auto known = index_in_path.find(vertex);
      if (known == index_in_path.end()) {
        index_in_path[vertex] = path.size();
        path.push_back(vertex);
        continue;
      }
      const auto first = path.begin() + static_cast<std::ptrdiff_t>(known->second);
      loops.emplace_back(first, path.end());
      for (auto v = first + 1; v != path.end(); ++v) index_in_path.erase(*v);
      path.erase(first + 1, path.end());
    }
  }
  return loops;
}

struct Diagonal {
  double length_sq;
  std::uint32_t cut_off;  // index in the loop
  std::uint32_t before, after;

  bool operator<(const Diagonal& other) const {
    return length_sq != other.length_sq ? length_sq > other.length_sq : cut_off > other.cut_off;
  }
};

// Triangulates a loop, shortest diagonal first.
void close(const Loop& loop, CancelWatch* watch, TriangleMesh* caps) {
  const auto n = static_cast<std::uint32_t>(loop.size());
  std::vector<std::uint32_t> before(n), after(n);
  std::priority_queue<Diagonal> shortest;
  const auto push = [&](std::uint32_t i) {
    const Eigen::Vector3d& a = caps->vertices[loop[before[i]]];
    const Eigen::Vector3d& b = caps->vertices[loop[after[i]]];
    shortest.push({(a - b).squaredNorm(), i, before[i], after[i]});
  };
  for (std::uint32_t i = 0; i < n; ++i) {
    before[i] = (i + n - 1) % n;
    after[i] = (i + 1) % n;
  }
  for (std::uint32_t i = 0; i < n; ++i) push(i);
  constexpr auto kRemoved = static_cast<std::uint32_t>(-1);
  for (std::uint32_t remaining = n; remaining >= 3;) {
    watch->step();
    const Diagonal cut = shortest.top();
    shortest.pop();
    const std::uint32_t i = cut.cut_off;
    if (before[i] != cut.before || after[i] != cut.after) continue;  // outdated
    // The cap passes its edges against the loop's direction.
    caps->triangles.push_back({loop[cut.after], loop[i], loop[cut.before]});
    after[cut.before] = cut.after;
    before[cut.after] = cut.before;
    before[i] = after[i] = kRemoved;
    --remaining;
    push(cut.before);
    push(cut.after);
  }
}

}  // namespace

TriangleMesh hole_caps(const TriangleMesh& mesh, const std::vector<OpenEdge>& open,
                       const CancelRequest& cancelled) {
  CancelWatch watch(cancelled);
  TriangleMesh caps;
  caps.vertices = mesh.vertices;
  for (const Loop& loop : find_loops(open, &watch)) close(loop, &watch, &caps);
  return caps;
}

}  // namespace ist
