#include "cloud/index/scene_axes.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "cloud/format/point_reader.h"

namespace ist {
namespace {

constexpr std::size_t kRows = 12, kColumns = 16;     // samples of an organized cloud
constexpr std::size_t kSteps = 32;                   // sizes of a sample along the cloud's side
constexpr std::size_t kPoints = 1024;                // samples of an unorganized cloud
constexpr std::size_t kSeeds = 96, kNeighbours = 8;  // planes, and the points of each
constexpr std::size_t kMostNormals = kRows * kColumns;
constexpr float kFlat = 0.1F;     // extent off a plane, as a share of the extent along it
constexpr float kSame = 0.9962F;  // cosine between normals of one surface: 5 degrees
constexpr float kAcross = 0.1F;   // cosine between perpendicular normals, at most
static_assert(kSeeds <= kMostNormals, "the normals' storage is fixed");

// Normals of samples, in the fixed frame.
class Normals {
 public:
  void add(const Eigen::Vector3f& normal) { normals_.col(size_++) = normal; }
  Eigen::Index size() const { return size_; }

  // The direction that most of them share, whatever their sign.
  // @param across  only normals perpendicular to this one count; zero: all
  // @param enough  the direction is zero where fewer share it
  Eigen::Vector3f most_common(const Eigen::Vector3f& across, Eigen::Index enough) const {
    Eigen::Index best = 0, most = 0;
    for (Eigen::Index i = 0; i < size_; i += 2) {
      if (std::abs(normals_.col(i).dot(across)) > kAcross) continue;
      const Eigen::Index same = (cosines(normals_.col(i)).abs() > kSame).count();
      if (same > most) {
        best = i;
        most = same;
      }
    }
    if (most < enough) return Eigen::Vector3f::Zero();
    Eigen::Vector3f mean = normals_.col(best);
    for (int i = 0; i < 3; ++i) mean = mean_about(mean);
    return mean;
  }

 private:
  using Samples = Eigen::Matrix<float, 3, Eigen::Dynamic, 0, 3, kMostNormals>;
  using Cosines = Eigen::Array<float, 1, Eigen::Dynamic, Eigen::RowMajor, 1, kMostNormals>;

  Cosines cosines(const Eigen::Vector3f& direction) const {
    return (direction.transpose() * normals_.leftCols(size_)).array();
  }

  Eigen::Vector3f mean_about(const Eigen::Vector3f& direction) const {
    const Cosines cosine = cosines(direction);
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();
    for (Eigen::Index i = 0; i < size_; ++i) {
      if (std::abs(cosine[i]) > kSame) sum += std::copysign(1.0F, cosine[i]) * normals_.col(i);
    }
    return sum.normalized();
  }

  Samples normals_ = Samples(3, static_cast<Eigen::Index>(kRows* kColumns));
  Eigen::Index size_ = 0;
};

// Normals of squares of pixels, spread over an organized cloud.
Normals sample_organized(const RawCloud& cloud, const Eigen::Matrix3d& R_FS) {
  Normals normals;
  const std::size_t side = std::max<std::size_t>(2, std::min(cloud.width, cloud.height) / kSteps);
  if (cloud.width <= side || cloud.height <= side) return normals;
  for (std::size_t i = 0; i < kRows * kColumns; ++i) {
    const std::size_t row = (cloud.height - side) * (2 * (i / kColumns) + 1) / (2 * kRows);
    const std::size_t column = (cloud.width - side) * (2 * (i % kColumns) + 1) / (2 * kColumns);
    const Eigen::Vector3d corner = point_at(cloud, row, column);
    const Eigen::Vector3f across = (point_at(cloud, row, column + side) - corner).cast<float>();
    const Eigen::Vector3f down = (point_at(cloud, row + side, column) - corner).cast<float>();
    const Eigen::Vector3f far = (point_at(cloud, row + side, column + side) - corner).cast<float>();
    const Eigen::Vector3f normal = across.cross(down).normalized();
    // False where anything is not finite.
    if (normal.squaredNorm() > 0.5F && std::abs(normal.dot(far)) <= kFlat * far.norm()) {
      normals.add(R_FS.cast<float>() * normal);
    }
  }
  return normals;
}

// Some points of an unorganized cloud, in the message's order.
struct SampledPoints {
  static constexpr std::size_t kBlock = 16;
  static constexpr float kInfinity = std::numeric_limits<float>::infinity();
  static_assert(kPoints % kBlock == 0, "whole blocks");
  using Block = Eigen::Array<float, kBlock, 1>;
  using BlockMap = Eigen::Map<const Block>;

  std::array<float, kPoints> x, y, z;
  std::size_t size = 0;

  SampledPoints(const RawCloud& cloud, const Eigen::Matrix3d& R_FS) {
    // An odd stride: rows of a scanner have even lengths, and samples are to spread over the
    // columns.
    const std::size_t stride = std::max<std::size_t>(1, cloud.size() / kPoints) | 1U;
    Eigen::Vector3d first;
    for (std::size_t i = 0; i < cloud.size() && size < kPoints; i += stride) {
      const Eigen::Vector3d p_S = point_at(cloud, i / cloud.width, i % cloud.width);
      if (!p_S.allFinite()) continue;
      if (size == 0) first = p_S;
      const Eigen::Vector3f p = (R_FS * (p_S - first)).cast<float>();
      x[size] = p.x();
      y[size] = p.y();
      z[size] = p.z();
      ++size;
    }
    for (std::size_t i = size; i % kBlock != 0; ++i) x[i] = y[i] = z[i] = kInfinity;
  }
  Eigen::Vector3f point(std::size_t i) const { return {x[i], y[i], z[i]}; }

  // The points nearest to one of them, itself among them.
  std::array<std::size_t, kNeighbours> neighbours_of(std::size_t seed) const {
    std::array<std::size_t, kNeighbours> nearest;
    std::array<float, kNeighbours> distance_sq;
    distance_sq.fill(kInfinity);
    nearest.fill(seed);
    for (std::size_t first = 0; first < size; first += kBlock) {
      // Eigen turns it into SIMD; mostly none of them is near.
      const Block block_sq = (BlockMap(&x[first]) - x[seed]).square() +
                             (BlockMap(&y[first]) - y[seed]).square() +
                             (BlockMap(&z[first]) - z[seed]).square();
      if (!(block_sq.minCoeff() < distance_sq.back())) continue;
      for (std::size_t k = 0; k < kBlock; ++k) {
        const float d_sq = block_sq[static_cast<Eigen::Index>(k)];
        if (!(d_sq < distance_sq.back())) continue;
        std::size_t at = kNeighbours - 1;
        for (; at > 0 && distance_sq[at - 1] > d_sq; --at) {
          distance_sq[at] = distance_sq[at - 1];
          nearest[at] = nearest[at - 1];
        }
        distance_sq[at] = d_sq;
        nearest[at] = first + k;
      }
    }
    return nearest;
  }
};

// Normals of planes through neighbouring points of an unorganized cloud.
Normals sample_unorganized(const RawCloud& cloud, const Eigen::Matrix3d& R_FS) {
  Normals normals;
  const SampledPoints samples(cloud, R_FS);
  if (samples.size < 8 * kNeighbours) return normals;
  for (std::size_t i = 0; i < kSeeds; ++i) {
    Eigen::Matrix<float, 3, static_cast<int>(kNeighbours)> points;
    Eigen::Index column = 0;
    for (const std::size_t k : samples.neighbours_of(i * samples.size / kSeeds)) {
      points.col(column++) = samples.point(k);
    }
    points.colwise() -= points.rowwise().mean().eval();
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3f> axes;
    axes.computeDirect(points * points.transpose());
    const Eigen::Vector3f& spread_sq = axes.eigenvalues();
    const bool is_plane = spread_sq[1] > kFlat * kFlat * spread_sq[2];  // not a line
    if (is_plane && spread_sq[0] <= kFlat * kFlat * spread_sq[1]) {
      normals.add(axes.eigenvectors().col(0));
    }
  }
  return normals;
}

// A rotation with these two axes, as near to the identity as their order and signs allow.
Eigen::Matrix3d axes_of(const Eigen::Vector3d& first, const Eigen::Vector3d& second) {
  Eigen::Index i, j;
  first.cwiseAbs().maxCoeff(&i);
  Eigen::Vector3d others = second.cwiseAbs();
  others[i] = -1.0;
  others.maxCoeff(&j);
  const Eigen::Index k = 3 - i - j;
  Eigen::Matrix3d R;
  R.col(i) = std::copysign(1.0, first[i]) * first;
  R.col(j) = std::copysign(1.0, second[j]) * second;
  R.col(k) = (j == (i + 1) % 3 ? 1.0 : -1.0) * R.col(i).cross(R.col(j));
  return R;
}

// The axis of a frame that is most nearly perpendicular to a direction. For an organized cloud the
// frame is the sensor's: squares of pixels lie along its axes.
Eigen::Vector3d most_perpendicular(const Eigen::Vector3d& n, const Eigen::Matrix3d& axes) {
  Eigen::Index least;
  (axes.transpose() * n).cwiseAbs().minCoeff(&least);
  return axes.col(least);
}

}  // namespace

Eigen::Matrix3d scene_axes(const RawCloud& cloud, const Eigen::Matrix3d& R_FS, bool is_organized) {
  const Normals normals =
      is_organized ? sample_organized(cloud, R_FS) : sample_unorganized(cloud, R_FS);
  const Eigen::Index enough = std::max<Eigen::Index>(8, normals.size() / 8);
  const Eigen::Vector3f first = normals.most_common(Eigen::Vector3f::Zero(), enough);
  if (first.isZero()) return Eigen::Matrix3d::Identity();
  const Eigen::Vector3d n = first.cast<double>().normalized();
  Eigen::Vector3d other = normals.most_common(first, enough).cast<double>();
  if (other.isZero())
    other = most_perpendicular(n, is_organized ? R_FS : Eigen::Matrix3d::Identity());
  return axes_of(n, (other - other.dot(n) * n).normalized());
}

}  // namespace ist
