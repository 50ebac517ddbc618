#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "internal/geometry/triangle_bvh.h"
#include "peers/flat.h"

// A precomputed grid of distances around each link, looked up for every point that the link's box
// does not prune. The witness point on the link is the point moved along the grid's gradient.
namespace ist::benchmark {
namespace {

constexpr float kCell = 0.0075F;  // [m]
constexpr float kMargin =
    0.1F;  // [m] around the link's box; points outside are projected onto the grid

struct Grid {
  Eigen::Vector3f low;
  Eigen::Vector3i size;         // nodes
  std::vector<float> distance;  // [m] unsigned, by node, x fastest

  explicit Grid(const TriangleMesh& mesh) {
    const TriangleBvh bvh(mesh);
    const Eigen::Vector3f min = bvh.bounds().min().cast<float>().array() - kMargin;
    const Eigen::Vector3f max = bvh.bounds().max().cast<float>().array() + kMargin;
    low = min;
    size = ((max - min) / kCell).array().ceil().cast<int>() + 1;
    for (int z = 0; z < size.z(); ++z) {
      for (int y = 0; y < size.y(); ++y) {
        for (int x = 0; x < size.x(); ++x) {
          const Eigen::Vector3f p =
              low + kCell * Eigen::Vector3f(Eigen::Vector3i(x, y, z).cast<float>());
          distance.push_back(
              static_cast<float>(std::sqrt(bvh.closest(p.cast<double>()).distance_sq)));
        }
      }
    }
  }

  float at(int x, int y, int z) const {
    return distance[static_cast<std::size_t>((z * size.y() + y) * size.x() + x)];
  }

  // Interpolates between the nodes. Outside, the distance to the nearest point inside is added.
  float operator()(const Eigen::Vector3f& p) const {
    const Eigen::Vector3f last = size.cast<float>().array() - 1.001F;
    const Eigen::Vector3f want = (p - low) / kCell;
    const Eigen::Vector3f g = want.cwiseMax(0.0F).cwiseMin(last);
    const Eigen::Vector3i i = g.cast<int>();
    const Eigen::Vector3f f = g - i.cast<float>();
    float sum = 0.0F;
    for (int corner = 0; corner < 8; ++corner) {
      const int a = corner & 1, b = corner >> 1 & 1, c = corner >> 2;
      const float weight = (a != 0 ? f.x() : 1.0F - f.x()) * (b != 0 ? f.y() : 1.0F - f.y()) *
                           (c != 0 ? f.z() : 1.0F - f.z());
      sum += weight * at(i.x() + a, i.y() + b, i.z() + c);
    }
    return sum + kCell * (want - g).norm();
  }

  Eigen::Vector3f slope(const Eigen::Vector3f& p) const {
    const float h = 0.5F * kCell;
    Eigen::Vector3f n;
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3f step = h * Eigen::Vector3f::Unit(axis);
      n[axis] = (*this)(p + step) - (*this)(p - step);
    }
    return n.normalized();
  }
};

class SignedGrid : public PrunedByBox {
 public:
  explicit SignedGrid(const Robot& robot) : PrunedByBox(robot) {
    name = "distance grid of 7.5 mm, link boxes";
    kind = Kind::kGrid;
    is_unsigned = false;
    for (const TriangleMesh& mesh : robot.meshes) grids_.emplace_back(mesh);
    // Within a cell the distance differs from the nodes' mean by at most half the diagonal. Outside
    // the grid, the path over its side is longer than the straight one, by less than the side's
    // length.
    least_error = -0.5 * std::sqrt(3.0) * static_cast<double>(kCell);
    largest_error = std::numeric_limits<double>::infinity();
    witness_error = std::numeric_limits<double>::infinity();
  }

 protected:
  bool closest(std::size_t link, const Eigen::Vector3f& p_L, float* distance,
               Eigen::Vector3d* surface_L) override {
    const float d = grids_[link](p_L);
    if (!(d < *distance)) return false;
    *distance = d;
    *surface_L = (p_L - d * grids_[link].slope(p_L)).cast<double>();
    return true;
  }

 private:
  std::vector<Grid> grids_;
};

}  // namespace

void add_signed_grid(const Robot& robot, Methods* methods) {
  methods->push_back(std::make_unique<SignedGrid>(robot));
}

}  // namespace ist::benchmark
