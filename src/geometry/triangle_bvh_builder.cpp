#include "geometry/triangle_bvh_builder.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "internal/geometry/float_rounding.h"

namespace ist {
namespace {

constexpr float kFar = 1e9F;

Eigen::Vector3d centroid(const TriangleBvh::Triangle& t) { return (t.a + t.b + t.c) / 3.0; }

// The corner opposite the longest edge: there the angle is largest and the normal most certain.
int apex_of(const TriangleMesh& mesh, std::uint32_t t) {
  int apex = 0;
  double longest_sq = -1.0;
  for (int k = 0; k < 3; ++k) {
    const double edge_sq =
        (mesh.corner(t, (k + 2) % 3) - mesh.corner(t, (k + 1) % 3)).squaredNorm();
    if (!(edge_sq > longest_sq)) continue;
    longest_sq = edge_sq;
    apex = k;
  }
  return apex;
}

// A triangle with its corners in the same sense, a being the apex.
TriangleBvh::Triangle from_apex(const TriangleMesh& mesh, std::uint32_t t) {
  const int apex = apex_of(mesh, t);
  return {mesh.corner(t, apex), mesh.corner(t, (apex + 1) % 3), mesh.corner(t, (apex + 2) % 3), t};
}

Eigen::Vector3d area_normal(const TriangleBvh::Triangle& t) {
  return 0.5 * (t.b - t.a).cross(t.c - t.a);
}

}  // namespace

void TriangleBvhBuilder::run() {
  triangles_.reserve(mesh_.triangles.size());
  for (std::uint32_t t = 0; t < mesh_.triangles.size(); ++t) {
    triangles_.push_back(from_apex(mesh_, t));
    for (int k = 0; k < 3; ++k) bvh_.bounds_.extend(mesh_.corner(t, k));
  }
  if (triangles_.empty()) return;
  origin_ = bvh_.bounds_.center();
  add_node({0, static_cast<std::uint32_t>(triangles_.size())});
  store_triangles();
}

// Vertices are in the order of their first triangle, so that those of a leaf are near each other.
void TriangleBvhBuilder::store_triangles() {
  constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();
  std::vector<std::uint32_t> place(mesh_.vertices.size(), kNone);
  std::uint32_t used = 0;
  const auto find = [&](std::uint32_t vertex) {
    if (place[vertex] == kNone) place[vertex] = used++;
    return place[vertex];
  };
  bvh_.triangles_.reserve(triangles_.size());
  for (const TriangleBvh::Triangle& triangle : triangles_) {
    const TriangleMesh::Triangle& vertices = mesh_.triangles[triangle.index];
    const auto apex = static_cast<std::size_t>(apex_of(mesh_, triangle.index));
    const std::uint32_t a = find(vertices[apex]), b = find(vertices[(apex + 1) % 3]),
                        c = find(vertices[(apex + 2) % 3]);
    bvh_.triangles_.push_back({a, b, c, triangle.index});
  }
  bvh_.vertices_.resize(used);
  for (std::size_t i = 0; i < place.size(); ++i) {
    if (place[i] != kNone) bvh_.vertices_[place[i]] = mesh_.vertices[i];
  }
}

// Splits at the median along the longest axis of the centroids' box.
std::uint32_t TriangleBvhBuilder::split(const Range& range) {
  constexpr std::uint32_t kAskFrom = 4096;  // triangles; smaller parts take microseconds
  if (range.second - range.first >= kAskFrom) throw_if(cancelled_);
  std::vector<TriangleBvh::Triangle>& triangles = triangles_;
  Eigen::AlignedBox3d box;
  for (std::uint32_t t = range.first; t < range.second; ++t) box.extend(centroid(triangles[t]));
  Eigen::Index axis;
  box.sizes().maxCoeff(&axis);
  const std::uint32_t middle = range.first + (range.second - range.first) / 2;
  const auto key = [axis](const TriangleBvh::Triangle& t) {
    return t.a[axis] + t.b[axis] + t.c[axis];
  };
  std::nth_element(triangles.begin() + range.first, triangles.begin() + middle,
                   triangles.begin() + range.second,
                   [&](const TriangleBvh::Triangle& s, const TriangleBvh::Triangle& t) {
                     const double ks = key(s), kt = key(t);
                     return ks < kt || (ks == kt && s.index < t.index);
                   });
  return middle;
}

std::int32_t TriangleBvhBuilder::add_node(const Range& range) {
  constexpr auto kWidth = static_cast<std::uint32_t>(TriangleBvh::kWidth);
  const std::size_t index = bvh_.boxes_.size();
  bvh_.boxes_.emplace_back();
  bvh_.slabs_.emplace_back();
  bvh_.moments_.emplace_back();
  std::vector<Range> groups{range};
  for (int level = 0; level < 3; ++level) {
    std::vector<Range> halves;
    for (const Range& group : groups) {
      if (group.second - group.first <= kWidth) {
        halves.push_back(group);
        continue;
      }
      const std::uint32_t middle = split(group);
      halves.push_back({group.first, middle});
      halves.push_back({middle, group.second});
    }
    groups = std::move(halves);
  }
  TriangleBvh::Boxes boxes{};
  TriangleBvh::Slabs slabs{};
  TriangleBvh::Moments moments{};
  boxes.count = static_cast<std::int32_t>(groups.size());
  for (std::size_t slot = 0; slot < kWidth; ++slot) {
    if (slot >= groups.size()) {
      // Unused slots are so far away that they are never nearest and have no winding number.
      for (int axis = 0; axis < 3; ++axis) boxes.min[axis][slot] = boxes.max[axis][slot] = kFar;
      moments.x[slot] = moments.y[slot] = moments.z[slot] = kFar;
      continue;
    }
    const Range& group = groups[slot];
    set_box(group, &boxes, slot);
    set_slab(group, &slabs, slot);
    set_moments(group, &moments, slot);
    boxes.child[slot] = group.second - group.first <= kWidth ? ~add_leaf(group) : add_node(group);
  }
  bvh_.boxes_[index] = boxes;
  bvh_.slabs_[index] = slabs;
  bvh_.moments_[index] = moments;
  return static_cast<std::int32_t>(index);
}

std::int32_t TriangleBvhBuilder::add_leaf(const Range& range) {
  TriangleBvh::Leaf leaf{};
  leaf.first = range.first;
  leaf.count = range.second - range.first;
  for (std::uint32_t slot = 0; slot < TriangleBvh::kWidth; ++slot) {
    // Unused slots repeat one corner of the last triangle three times, which has no solid angle.
    const bool used = slot < leaf.count;
    const TriangleBvh::Triangle& t = triangles_[range.first + std::min(slot, leaf.count - 1)];
    const Eigen::Vector3d corners[3] = {t.a, used ? t.b : t.a, used ? t.c : t.a};
    for (int corner = 0; corner < 3; ++corner) {
      for (int axis = 0; axis < 3; ++axis) {
        leaf.corner[3 * corner + axis][slot] =
            static_cast<float>(corners[corner][axis] - origin_[axis]);
      }
    }
  }
  bvh_.leaves_.push_back(leaf);
  return static_cast<std::int32_t>(bvh_.leaves_.size()) - 1;
}

void TriangleBvhBuilder::set_box(const Range& range, TriangleBvh::Boxes* boxes,
                                 std::size_t slot) const {
  Eigen::AlignedBox3d box;
  for (std::uint32_t t = range.first; t < range.second; ++t) {
    const TriangleBvh::Triangle& triangle = triangles_[t];
    box.extend(triangle.a).extend(triangle.b).extend(triangle.c);
  }
  for (int axis = 0; axis < 3; ++axis) {
    boxes->min[axis][slot] = -round_up(origin_[axis] - box.min()[axis]);
    boxes->max[axis][slot] = round_up(box.max()[axis] - origin_[axis]);
  }
}

void TriangleBvhBuilder::set_slab(const Range& range, TriangleBvh::Slabs* slabs,
                                  std::size_t slot) const {
  constexpr double kLength = 127.0;  // the largest std::int8_t
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (std::uint32_t t = range.first; t < range.second; ++t) mean += area_normal(triangles_[t]);
  const double largest = mean.cwiseAbs().maxCoeff();
  if (!(largest > 0.0) || !std::isfinite(largest)) return;
  // The squares of an area below 1e-154 m^2 are 0.
  const Eigen::Vector3d direction = (kLength * (mean / largest).normalized()).array().round();
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (std::uint32_t t = range.first; t < range.second; ++t) {
    const TriangleBvh::Triangle& triangle = triangles_[t];
    for (const Eigen::Vector3d& corner : {triangle.a, triangle.b, triangle.c}) {
      const double along = direction.dot(corner - origin_);
      low = std::min(low, along);
      high = std::max(high, along);
    }
  }
  for (int axis = 0; axis < 3; ++axis) {
    slabs->direction[axis][slot] = static_cast<std::int8_t>(direction[axis]);
  }
  slabs->low[slot] = round_down(low);
  slabs->high[slot] = round_up(high);
}

// The expansion is about the area-weighted centroid (Barill et al. 2018, section 3.2).
void TriangleBvhBuilder::set_moments(const Range& range, TriangleBvh::Moments* moments,
                                     std::size_t slot) const {
  double area = 0.0;
  Eigen::Vector3d weighted = Eigen::Vector3d::Zero(), plain = Eigen::Vector3d::Zero();
  Eigen::Vector3d dipole = Eigen::Vector3d::Zero();
  for (std::uint32_t i = range.first; i < range.second; ++i) {
    const Eigen::Vector3d n = area_normal(triangles_[i]);
    const Eigen::Vector3d middle = centroid(triangles_[i]) - origin_;
    area += n.norm();
    weighted += n.norm() * middle;
    plain += middle;
    dipole += n;
  }
  const double count = range.second - range.first;
  const Eigen::Vector3d center =
      Eigen::Vector3d(area > 0.0 ? weighted / area : plain / count).cast<float>().cast<double>();
  Eigen::Matrix3d quadrupole = Eigen::Matrix3d::Zero();
  double radius_sq = 0.0;
  for (std::uint32_t i = range.first; i < range.second; ++i) {
    const TriangleBvh::Triangle& t = triangles_[i];
    quadrupole += (centroid(t) - origin_ - center) * area_normal(t).transpose();
    for (const Eigen::Vector3d& corner : {t.a, t.b, t.c}) {
      radius_sq = std::max(radius_sq, (corner - origin_ - center).squaredNorm());
    }
  }
  const auto set = [slot](float* values, double value) {
    values[slot] = static_cast<float>(value);
  };
  set(moments->x, center.x());
  set(moments->y, center.y());
  set(moments->z, center.z());
  set(moments->radius_sq, radius_sq);
  set(moments->nx, dipole.x());
  set(moments->ny, dipole.y());
  set(moments->nz, dipole.z());
  set(moments->qxx, quadrupole(0, 0));
  set(moments->qyy, quadrupole(1, 1));
  set(moments->qzz, quadrupole(2, 2));
  set(moments->qxy, 0.5 * (quadrupole(0, 1) + quadrupole(1, 0)));
  set(moments->qxz, 0.5 * (quadrupole(0, 2) + quadrupole(2, 0)));
  set(moments->qyz, 0.5 * (quadrupole(1, 2) + quadrupole(2, 1)));
}

}  // namespace ist
