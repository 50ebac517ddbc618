#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "internal/geometry/triangle_bvh.h"
#include "ist_proximity/geometry/solid.h"
#include "peers/image_pyramid.h"

// Precomputed signed distances around each link, fine near it and coarse farther away, looked up
// for groups of pixels: a group's points are no nearer than its centre, less the group's radius.
namespace ist::benchmark {
namespace {

constexpr float kFineCell = 0.01F, kCoarseCell = 0.04F;     // [m]
constexpr float kFineMargin = 0.12F, kCoarseMargin = 1.0F;  // [m] around the link's box

// Signed distances at the nodes of a grid.
class Grid {
 public:
  // @param inside  nodes within may be inside the mesh; the others are not
  Grid(const TriangleBvh& bvh, const Solid& solid, const Eigen::AlignedBox3f& inside, float cell,
       float margin)
      : low_(inside.min().array() - margin), scale_(1.0F / cell), cell_(cell) {
    size_ = ((inside.sizes().array() + 2.0F * margin) * scale_).ceil().cast<int>() + 1;
    last_ = size_.cast<float>().array() - 1.0001F;
    values_.reserve(static_cast<std::size_t>(size_.prod()));
    for (int z = 0; z < size_.z(); ++z) {
      for (int y = 0; y < size_.y(); ++y) {
        for (int x = 0; x < size_.x(); ++x) {
          const Eigen::Vector3f p =
              low_ + cell * Eigen::Vector3f(Eigen::Vector3i(x, y, z).cast<float>());
          const Eigen::Vector3d q = p.cast<double>();
          values_.push_back(static_cast<float>(inside.contains(p)
                                                   ? solid.signed_distance(q).distance
                                                   : std::sqrt(bvh.closest(q).distance_sq)));
        }
      }
    }
  }

  bool contains(const Eigen::Vector3f& p) const {
    const Eigen::Array3f g = (p - low_).array() * scale_;
    return (g >= 0.0F).all() && (g <= last_).all();
  }

  // Trilinear. Outside, the distance to the nearest point of the grid is added.
  float operator()(const Eigen::Vector3f& p) const {
    const Eigen::Array3f want = (p - low_).array() * scale_;
    const Eigen::Array3f g = want.max(0.0F).min(last_);
    const Eigen::Array3i i = g.cast<int>();
    const Eigen::Array3f f = g - i.cast<float>();
    const float* v =
        &values_[static_cast<std::size_t>((i.z() * size_.y() + i.y()) * size_.x() + i.x())];
    const std::ptrdiff_t up = size_.x(), back = up * size_.y();
    const auto mix = [](float a, float b, float s) { return a + s * (b - a); };
    const float near = mix(mix(v[0], v[1], f.x()), mix(v[up], v[up + 1], f.x()), f.y());
    v += back;
    const float far = mix(mix(v[0], v[1], f.x()), mix(v[up], v[up + 1], f.x()), f.y());
    return mix(near, far, f.z()) + cell_ * (want - g).matrix().norm();
  }

  std::size_t bytes() const { return values_.size() * sizeof(float); }

 private:
  Eigen::Vector3f low_;
  float scale_, cell_;  // [1/m], [m]
  Eigen::Array3i size_;
  Eigen::Array3f last_;
  std::vector<float> values_;  // [m] by node, x fastest
};

// Both grids of a link.
class LinkGrid {
 public:
  explicit LinkGrid(const TriangleMesh& mesh) : LinkGrid(mesh, TriangleBvh(mesh)) {}

  float operator()(const Eigen::Vector3f& p) const {
    return fine_.contains(p) ? fine_(p) : coarse_(p);
  }

  Eigen::Vector3f slope(const Eigen::Vector3f& p) const {
    const float h = 0.5F * kFineCell;
    Eigen::Vector3f n;
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3f step = h * Eigen::Vector3f::Unit(axis);
      n[axis] = (*this)(p + step) - (*this)(p - step);
    }
    return n.normalized();
  }

  std::size_t bytes() const { return fine_.bytes() + coarse_.bytes(); }

 private:
  LinkGrid(const TriangleMesh& mesh, const TriangleBvh& bvh)
      : LinkGrid(bvh, Solid({GeometryElement{mesh, Eigen::Isometry3d::Identity(), "link"}}),
                 Eigen::AlignedBox3f(bvh.bounds().min().cast<float>(),
                                     bvh.bounds().max().cast<float>())) {}
  LinkGrid(const TriangleBvh& bvh, const Solid& solid, const Eigen::AlignedBox3f& box)
      : fine_(bvh, solid, box, kFineCell, kFineMargin),
        coarse_(bvh, solid, box, kCoarseCell, kCoarseMargin) {}

  Grid fine_, coarse_;
};

class SignedGrid : public OfGroups {
 public:
  explicit SignedGrid(const Robot& robot) : OfGroups(robot) {
    kind = "grid";
    std::size_t bytes = 0;
    for (const TriangleMesh& mesh : robot.meshes) {
      grids_.emplace_back(mesh);
      bytes += grids_.back().bytes();
    }
    name = "signed distance grid of 10 and 40 mm (" + std::to_string(bytes >> 20U) +
           " MB), hierarchy of spheres over the image";
    // Within a cell the distance differs from the nodes' mean by at most half the diagonal. Outside
    // the grids, the path over their side is longer than the straight one.
    least_error = -0.5 * std::sqrt(3.0) * static_cast<double>(kCoarseCell);
    largest_error = witness_error = std::numeric_limits<double>::infinity();
  }

  void query(const Poses& X_FL, std::vector<Answer>* answers) override {
    for (std::size_t link = 0; link < X_FL.size(); ++link) {
      const LinkGrid& grid = grids_[link];
      const auto distance = [&](const Eigen::Vector3f& p_L, float /*bound*/,
                                Eigen::Vector3f* /*witness_L*/) { return grid(p_L); };
      const auto surface = [&](const Eigen::Vector3f& p_L, float depth) {
        return Eigen::Vector3f(p_L - depth * grid.slope(p_L));
      };
      (*answers)[link] = find(link, X_FL[link], distance, surface);
    }
  }

 private:
  std::vector<LinkGrid> grids_;
};

}  // namespace

void add_signed_grid(const Robot& robot, Methods* methods) {
  methods->push_back(std::make_unique<SignedGrid>(robot));
}

}  // namespace ist::benchmark
