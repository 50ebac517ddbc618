// The axes of an index, which lie along the scene's surfaces, do not change the thinned cloud.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "ist_proximity/cloud/ingest.h"
#include "support/scene.h"
#include "support/tiles.h"
#include "support/whole_cloud.h"

namespace ist {
namespace {

constexpr std::size_t kWidth = 160, kHeight = 120;

// A depth image as its bytes: x, y, z as floats.
struct Image {
  std::vector<float> xyz;

  RawCloud raw() const { return packed_cloud(xyz.data(), kWidth, kHeight); }
};

// A camera's view into the corner of a room: the nearest of three planes across each other, at each
// pixel, with some noise along the ray.
// @param R_SR  the room's axes in the sensor frame
Image corner(const Eigen::Matrix3d& R_SR, double noise, test::Rng* rng) {
  std::normal_distribution<double> normal(0.0, 1.0);
  Image image;
  for (std::size_t v = 0; v < kHeight; ++v) {
    for (std::size_t u = 0; u < kWidth; ++u) {
      const Eigen::Vector3d ray(static_cast<double>(u) / 100.0 - 0.8,
                                static_cast<double>(v) / 100.0 - 0.6, 1.0);
      double depth = std::numeric_limits<double>::infinity();
      for (int axis = 0; axis < 3; ++axis) {
        const double here = (1.0 + 0.3 * axis) / std::abs(R_SR.col(axis).dot(ray));
        depth = std::min(depth, here);
      }
      const Eigen::Vector3d p = (depth + noise * normal(*rng)) * ray;
      for (int axis = 0; axis < 3; ++axis) image.xyz.push_back(static_cast<float>(p[axis]));
    }
  }
  return image;
}

// The voxels of thinning belong to the fixed frame, whatever the index's axes are, and stay the
// same from cloud to cloud.
TEST(SceneAxes, DoNotTurnTheThinnedCloud) {
  test::Rng rng(6);
  const Eigen::Matrix3d R_SR = test::random_pose(&rng, 0.0).linear();
  const Image image = corner(R_SR, 0.001, &rng);
  const Eigen::Isometry3d X_FS = test::random_pose(&rng, 1.0);
  CloudSnapshot snapshot;
  Ingest(test::whole_cloud(true)).run(image.raw(), X_FS, {}, 0.0, &snapshot);
  EXPECT_GT((snapshot.index.X_FO().linear() - Eigen::Matrix3d::Identity()).norm(), 0.1);
  // The thinned cloud holds one point of each voxel: up to rounding, the nearest to its centre.
  const double cell = snapshot.thinning;
  const auto cell_of = [&](const Eigen::Vector3d& p) {
    return Eigen::Vector3d((p / cell).array().floor());
  };
  const auto off_centre = [&](const Eigen::Vector3d& p) {
    return (p / cell - cell_of(p) - Eigen::Vector3d::Constant(0.5)).norm();
  };
  std::vector<std::pair<Eigen::Vector3d, double>> kept;
  for (const auto& [id, p] : test::thinned_points_of(snapshot.index)) {
    kept.emplace_back(cell_of(p), off_centre(p));
  }
  const auto before = [](const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
    return std::lexicographical_compare(a.data(), a.data() + 3, b.data(), b.data() + 3);
  };
  std::sort(kept.begin(), kept.end(),
            [&](const auto& a, const auto& b) { return before(a.first, b.first); });
  for (std::size_t i = 1; i < kept.size(); ++i) {
    ASSERT_TRUE(before(kept[i - 1].first, kept[i].first)) << "two in a cell";
  }
  std::size_t elsewhere = 0;
  for (const PointTile& tile : test::tiles_of(snapshot.index)) {
    for (int k = 0; k < tile.count; ++k) {
      const Eigen::Vector3d p = snapshot.index.X_FO() * tile.point(k);
      const auto at = std::lower_bound(
          kept.begin(), kept.end(), cell_of(p),
          [&](const auto& a, const Eigen::Vector3d& c) { return before(a.first, c); });
      if (at == kept.end() || at->first != cell_of(p)) {
        ++elsewhere;  // on the edge of two cells
        continue;
      }
      ASSERT_LE(at->second, off_centre(p) + 1e-3);
    }
  }
  EXPECT_LT(elsewhere, snapshot.index.size() / 1000);
}

}  // namespace
}  // namespace ist
