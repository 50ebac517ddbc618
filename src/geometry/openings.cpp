#include "internal/geometry/openings.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "geometry/solid_element.h"
#include "internal/geometry/boundary_edges.h"
#include "internal/geometry/hole_caps.h"
#include "internal/geometry/numbers.h"

namespace ist {
namespace {

// The error of a winding number, and some of rounding (TriangleBvh::winding_number).
constexpr double kWindingError = 0.011;
// Meshes of so few triangles are summed up in double, with that error: the side of a large sheet is
// a matter of small differences, and the sum costs less than a microsecond.
constexpr std::uint32_t kFewTriangles = 16;
constexpr double kSmallWindingError = 1e-6;
// Cells of an element, at most; and the radius [m] at which they are small enough.
constexpr std::size_t kMaxCells = 8192;
constexpr double kSmallCell = 1e-3;

TriangleMesh mesh_of(const TriangleBvh& bvh) {
  TriangleMesh mesh;
  for (std::uint32_t slot = 0; slot < bvh.size(); ++slot) {
    const TriangleBvh::Triangle& t = bvh.triangle(slot);
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    mesh.vertices.insert(mesh.vertices.end(), {t.a, t.b, t.c});
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

// The root of each number in a forest of parents.
class Forest {
 public:
  explicit Forest(std::size_t size) : parent_(size) {
    for (std::size_t i = 0; i < size; ++i) parent_[i] = i;
  }
  std::size_t root(std::size_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void join(std::size_t a, std::size_t b) { parent_[root(a)] = root(b); }

 private:
  std::vector<std::size_t> parent_;
};

// [m] A lower bound: of an edge, the distance to the segment.
template <typename Piece>
double distance_to(const Piece& piece, const Eigen::Vector3d& p) {
  const Eigen::Vector3d off = p - piece.middle;
  const double length_sq = piece.along.squaredNorm();
  if (!(length_sq > 0.0)) return off.norm() - piece.radius;
  return (off - std::clamp(off.dot(piece.along) / length_sq, -1.0, 1.0) * piece.along).norm();
}

// [1/m] An upper bound of the sum of weight / distance^power from a sphere.
template <int kPower, typename Piece>
double sum_of(const std::vector<Piece>& pieces, const Eigen::Vector3d& center, double radius) {
  double sum = 0.0;
  for (const Piece& piece : pieces) {
    const double distance = distance_to(piece, center) - radius;
    if (!(distance > 0.0)) return std::numeric_limits<double>::infinity();
    sum += piece.weight / (kPower == 3 ? distance * distance * distance : distance * distance);
  }
  return sum;
}

// Returns that of an element at p_L: the sum of solid angles over 4 pi (van Oosterom and Strackee
// 1983), or what the hierarchy approximates.
double winding_number(const SolidElement& solid, const Eigen::Vector3d& p_L) {
  const Eigen::Vector3d p_E = solid.X_EL * p_L;
  if (solid.bvh.size() > kFewTriangles) return solid.bvh.winding_number(p_E);
  double sum = 0.0;
  for (std::uint32_t slot = 0; slot < solid.bvh.size(); ++slot) {
    const TriangleBvh::Triangle& t = solid.bvh.triangle(slot);
    const Eigen::Vector3d a = t.a - p_E, b = t.b - p_E, c = t.c - p_E;
    const double la = a.norm(), lb = b.norm(), lc = c.norm();
    sum += std::atan2(a.dot((t.b - t.a).cross(t.c - t.a)),
                      la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
  }
  return sum / (2.0 * kPi);
}

double winding_error(const SolidElement& solid) {
  return solid.bvh.size() > kFewTriangles ? kWindingError : kSmallWindingError;
}

}  // namespace

Openings::Openings(const Solid& solid, const CancelRequest& cancelled) : solid_(solid) {
  const std::vector<SolidElement>& elements = elements_of(solid);
  for (std::size_t i = 0; i < elements.size(); ++i) {
    if (elements[i].is_closed || !elements[i].is_mesh()) continue;
    const Eigen::AlignedBox3d box = add_element(i, cancelled);
    if (elements_.back().holes.empty()) {
      elements_.pop_back();
    } else {
      add_cells(static_cast<std::uint32_t>(elements_.size() - 1), box, cancelled);
    }
  }
}

// Collects the holes of a mesh. @returns a box that holds all openings
Eigen::AlignedBox3d Openings::add_element(std::size_t index, const CancelRequest& cancelled) {
  const SolidElement& solid = elements_of(solid_)[index];
  const TriangleMesh mesh = mesh_of(solid.bvh);
  const std::vector<OpenEdge> open = open_edges(mesh, cancelled);
  const TriangleMesh caps = hole_caps(mesh, open, cancelled);
  Forest forest(mesh.vertices.size());
  CancelWatch watch(cancelled);
  for (const OpenEdge& edge : open) forest.join(edge.from, edge.to);
  std::map<std::size_t, Hole> holes;
  std::map<std::size_t, Eigen::AlignedBox3d> boxes;
  Eigen::AlignedBox3d box;
  for (const OpenEdge& edge : open) {
    watch.step();
    const Eigen::Vector3d from = solid.X_LE * mesh.vertices[edge.from];
    const Eigen::Vector3d to = solid.X_LE * mesh.vertices[edge.to];
    const double length = (to - from).norm();
    holes[forest.root(edge.from)].single_edges.push_back(
        {0.5 * (from + to), 0.5 * length, edge.count * length / (4.0 * kPi), 0.5 * (to - from)});
    holes[forest.root(edge.from)].count.push_back(edge.count);
    boxes[forest.root(edge.from)].extend(from).extend(to);
    box.extend(from).extend(to);
  }
  double area = 0.0;
  for (const TriangleMesh::Triangle& t : caps.triangles) {
    watch.step();
    const Eigen::Vector3d a = solid.X_LE * caps.vertices[t[0]],
                          b = solid.X_LE * caps.vertices[t[1]],
                          c = solid.X_LE * caps.vertices[t[2]], middle = (a + b + c) / 3.0;
    const double twice = (b - a).cross(c - a).norm();
    const double radius = std::sqrt(std::max(
        {(a - middle).squaredNorm(), (b - middle).squaredNorm(), (c - middle).squaredNorm()}));
    holes[forest.root(t[0])].single_caps.push_back(
        {middle, radius, twice / (4.0 * kPi), Eigen::Vector3d::Zero()});
    area += 0.5 * twice;
  }
  elements_.push_back({index, {}});
  for (auto& [root, hole] : holes) {
    watch.step();
    const Eigen::Vector3d middle = boxes[root].center();
    const double radius = 0.5 * boxes[root].sizes().norm();
    hole.edges = hole.caps = {middle, radius, 0.0, Eigen::Vector3d::Zero()};
    for (const Piece& edge : hole.single_edges) hole.edges.weight += edge.weight;
    for (const Piece& cap : hole.single_caps) hole.caps.weight += cap.weight;
    elements_.back().holes.push_back(std::move(hole));
  }
  // The winding number is an integer less that of the caps, which their solid angle bounds: it is
  // below 0.5 farther than sqrt(area / 2 pi) from them.
  const double range = 1.01 * std::sqrt(area / (2.0 * kPi)) + 1e-6;
  return {box.min().array() - range, box.max().array() + range};
}

// How much the winding number may change within a sphere: to first order by bounds of its gradient,
// or by its gradient at the centre and bounds of the second derivative.
struct Openings::Variation {
  void add(const Hole& hole, const Eigen::Vector3d& center_L, double radius) {
    const double distance = (hole.edges.middle - center_L).norm() - hole.edges.radius - radius;
    if (distance > 2.0 * hole.edges.radius) {
      const double bound = std::min(hole.edges.weight / (distance * distance),
                                    hole.caps.weight / (distance * distance * distance));
      first += bound;
      of_far += bound;
      return;
    }
    first += std::min(sum_of<2>(hole.single_edges, center_L, radius),
                      sum_of<3>(hole.single_caps, center_L, radius));
    second += 2.0 * sum_of<3>(hole.single_edges, center_L, radius);
    for (std::size_t i = 0; i < hole.count.size() && second < kInfinity; ++i) {
      const Piece& edge = hole.single_edges[i];
      const Eigen::Vector3d a = edge.middle - edge.along - center_L;
      const Eigen::Vector3d b = edge.middle + edge.along - center_L;
      const double la = a.norm(), lb = b.norm();
      const double share = hole.count[i] * (la + lb) / (la * lb * (la * lb + a.dot(b)));
      field += share * a.cross(b);
    }
  }
  double within(double radius) const {
    const double slope = field.norm() / (4.0 * kPi) * (1.0 + 1e-9) + of_far;
    return std::min(first * radius, (slope + 0.5 * second * radius) * radius);
  }

  double first = 0.0, of_far = 0.0, second = 0.0;
  Eigen::Vector3d field = Eigen::Vector3d::Zero();
};

Openings::Side Openings::side(std::uint32_t element, const Eigen::Vector3d& center_L,
                              double radius) const {
  const SolidElement& solid = elements_of(solid_)[elements_[element].index];
  const double winding = winding_number(solid, center_L), error = winding_error(solid);
  if (may_hold_opening(elements_[element], {winding, error}, center_L, radius)) {
    return winding > 0.5 + error ? Side::kInside : Side::kMayChange;
  }
  return winding > 0.5 ? Side::kInside : Side::kOutside;
}

bool Openings::may_hold_opening(const Element& element, const Winding& winding,
                                const Eigen::Vector3d& center_L, double radius) {
  const double share = winding.number - std::floor(winding.number);
  const double margin = std::abs(share - 0.5) - winding.error;
  if (!(margin > 0.0)) return true;
  Variation variation;
  for (const Hole& hole : element.holes) variation.add(hole, center_L, radius);
  return !(variation.within(radius) < margin);
}

// Level by level, as long as there are not too many cells and they are not small.
void Openings::add_cells(std::uint32_t number, const Eigen::AlignedBox3d& box,
                         const CancelRequest& cancelled) {
  const Element& element = elements_[number];
  const SolidElement& solid = elements_of(solid_)[element.index];
  const double per_half = std::sqrt(3.0) * (1.0 + 1e-9);
  double half = 0.5 * box.sizes().maxCoeff();
  std::vector<Eigen::Vector3d> cells = {box.center()};
  while (cells.size() <= kMaxCells / 4 && per_half * half > kSmallCell) {
    std::vector<Eigen::Vector3d> smaller;
    half *= 0.5;
    for (const Eigen::Vector3d& center : cells) {
      throw_if(cancelled);
      for (int corner = 0; corner < 8; ++corner) {
        const Eigen::Vector3d at =
            center + half * Eigen::Vector3d((corner & 1) != 0 ? 1 : -1, (corner & 2) != 0 ? 1 : -1,
                                            (corner & 4) != 0 ? 1 : -1);
        const Winding winding{winding_number(solid, at), winding_error(solid)};
        if (may_hold_opening(element, winding, at, per_half * half)) smaller.push_back(at);
      }
    }
    cells = std::move(smaller);
  }
  for (const Eigen::Vector3d& center : cells) {
    cells_.push_back({ConvexPart::Kind::kSphere, center, center, center, per_half * half, number});
  }
}

}  // namespace ist
