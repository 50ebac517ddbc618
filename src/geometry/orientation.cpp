#include "geometry/orientation.h"

#include <Eigen/Geometry>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <numeric>
#include <utility>
#include <vector>

#include "internal/geometry/triangle_bvh.h"

namespace ist {
namespace {

// The largest sum of directed areas, as a share of the area, of a surface that counts as closed.
// The sum is 0 for closed surfaces, 0.2 for an open box, and 0.08 for the worst of the Panda's
// meshes, with all their holes.
constexpr double kMaxOpening = 0.1;
// Surfaces with less volume than this share of area^1.5 are sheets: neither side is outside.
constexpr double kMinVolume = 1e-9;

// Pairs of shells to test for nesting, at most: about a second. Meshes with more pairs, of many
// thousand shells of which many are inside out, stay as they are.
constexpr std::size_t kMaxPairs = 200000000;

using Triangles = std::vector<std::size_t>;

bool is_inside_out(const TriangleMesh& mesh, const Triangles& triangles) {
  Eigen::Vector3d directed_area = Eigen::Vector3d::Zero(), moment = Eigen::Vector3d::Zero();
  double area = 0.0, volume = 0.0;
  for (const std::size_t t : triangles) {
    const Eigen::Vector3d &a = mesh.corner(t, 0), &b = mesh.corner(t, 1), &c = mesh.corner(t, 2);
    const Eigen::Vector3d n = (b - a).cross(c - a);
    directed_area += n;
    moment += n.norm() * (a + b + c) / 3.0;
    area += n.norm();
    volume += a.dot(n);
  }
  if (!(area > 0.0) || directed_area.norm() > kMaxOpening * area) return false;
  volume -=
      directed_area.dot(moment / area);  // about the centroid, or the holes' place would matter
  return volume < -kMinVolume * area * std::sqrt(area);
}

void flip(TriangleMesh* mesh, const Triangles& triangles) {
  for (const std::size_t t : triangles) std::swap(mesh->triangles[t][1], mesh->triangles[t][2]);
}

// Connected components of triangles that share vertices, in the order of their first triangles.
std::vector<Triangles> find_shells(const TriangleMesh& mesh) {
  std::vector<std::uint32_t> parent(mesh.vertices.size());
  std::iota(parent.begin(), parent.end(), 0U);
  const auto root = [&parent](std::uint32_t v) {
    while (parent[v] != v) v = parent[v] = parent[parent[v]];
    return v;
  };
  for (const TriangleMesh::Triangle& t : mesh.triangles) {
    parent[root(t[1])] = root(t[0]);
    parent[root(t[2])] = root(t[0]);
  }
  std::vector<std::size_t> shell_of(mesh.vertices.size(), mesh.triangles.size());
  std::vector<Triangles> shells;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    std::size_t& shell = shell_of[root(mesh.triangles[t][0])];
    if (shell == mesh.triangles.size()) {
      shell = shells.size();
      shells.emplace_back();
    }
    shells[shell].push_back(t);
  }
  return shells;
}

// Pairs of shells that are tested before the caller is asked whether to go on: some milliseconds at
// most.
constexpr std::size_t kAskEvery = 4096;

// Decides which shells lie within which others.
class Nesting {
 public:
  Nesting(const TriangleMesh& mesh, const std::vector<Triangles>& shells,
          const CancelRequest& cancelled)
      : mesh_(mesh), shells_(shells), cancelled_(cancelled) {
    for (const Triangles& shell : shells) {
      Eigen::AlignedBox3d box;
      for (const std::size_t t : shell) {
        for (int k = 0; k < 3; ++k) box.extend(mesh.corner(t, k));
      }
      boxes_.push_back(box);
    }
  }

  bool is_within(std::size_t inner, std::size_t outer) {
    if (++asked_ % kAskEvery == 0) throw_if(cancelled_);
    if (inner == outer || !boxes_[outer].contains(boxes_[inner])) return false;
    const Eigen::Vector3d& p = mesh_.corner(shells_[inner].front(), 0);
    return std::abs(surface(outer).winding_number(p)) > 0.5;
  }

 private:
  const TriangleBvh& surface(std::size_t shell) {
    const auto found = surfaces_.find(shell);
    if (found != surfaces_.end()) return found->second;
    TriangleMesh part;  // with its own corners alone: a mesh may have ten thousand shells
    for (const std::size_t t : shells_[shell]) {
      const auto first = static_cast<std::uint32_t>(part.vertices.size());
      for (int k = 0; k < 3; ++k) part.vertices.push_back(mesh_.corner(t, k));
      part.triangles.push_back({first, first + 1, first + 2});
    }
    return surfaces_.emplace(shell, TriangleBvh(part, cancelled_)).first->second;
  }

  const TriangleMesh& mesh_;
  const std::vector<Triangles>& shells_;
  const CancelRequest& cancelled_;
  std::vector<Eigen::AlignedBox3d> boxes_;
  std::map<std::size_t, TriangleBvh> surfaces_;
  std::size_t asked_ = 0;
};

}  // namespace

void orient_outward(TriangleMesh* mesh, const CancelRequest& cancelled) {
  throw_if(cancelled);
  Triangles all(mesh->triangles.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  if (is_inside_out(*mesh, all)) flip(mesh, all);
  throw_if(cancelled);
  const std::vector<Triangles> shells = find_shells(*mesh);
  throw_if(cancelled);
  if (shells.size() < 2) return;
  std::vector<std::size_t> inside_out;
  for (std::size_t s = 0; s < shells.size(); ++s) {
    if (is_inside_out(*mesh, shells[s])) inside_out.push_back(s);
  }
  if (inside_out.empty() || inside_out.size() > kMaxPairs / shells.size()) return;
  Nesting nesting(*mesh, shells, cancelled);
  std::vector<bool> flips(shells.size(), false);
  for (const std::size_t s : inside_out) {
    bool is_outermost = true;
    for (std::size_t other = 0; other < shells.size() && is_outermost; ++other) {
      is_outermost = !nesting.is_within(s, other);
    }
    if (!is_outermost) continue;
    for (std::size_t other = 0; other < shells.size(); ++other) {
      if (other == s || nesting.is_within(other, s)) flips[other] = true;
    }
  }
  for (std::size_t s = 0; s < shells.size(); ++s) {
    if (flips[s]) flip(mesh, shells[s]);
  }
}

}  // namespace ist
