// From image to image: what a query keeps of one image must not be taken for the next one, whatever
// has changed between them.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "support/images.h"
#include "support/meshes.h"
#include "support/oracle.h"
#include "support/scene.h"

namespace ist {
namespace {

using test::Image;
using test::wall;

// Two links in front of the wall, a query that goes on from image to image, and the truth by brute
// force.
class ImageToImage : public ::testing::Test {
 protected:
  ImageToImage() {
    meshes_ = {test::l_shape(0.2, 0.05), test::open_box({0.1, 0.1, 0.15})};
    model_ = test::make_model({meshes_[0], meshes_[1]}, 0.005);
    X_FL_ = {test::random_pose(&rng_, 0.0), test::random_pose(&rng_, 0.0)};
    X_FL_[0].translation() = Eigen::Vector3d(-0.1, 0.0, 0.8);
    X_FL_[1].translation() = Eigen::Vector3d(0.15, 0.05, 0.9);
    config_.max_distance = 3.0;
  }

  // [m] Of all points in the regions.
  double truth(std::size_t link, const std::vector<Image>& images,
               const RegionOfInterest& region) const {
    std::vector<Eigen::Vector3d> points_L;
    for (const Image& image : images) {
      for (std::size_t i = 0; i < image.width * image.height; ++i) {
        const Eigen::Vector3d p =
            Eigen::Map<const Eigen::Vector3f>(&image.data[4 * i]).cast<double>();
        if (!p.allFinite() || (p - region.center_F).norm() > region.radius) continue;
        points_L.push_back(X_FL_[link].inverse() * p);
      }
    }
    return test::oracle_minimum(meshes_[link], points_L);
  }

  // Asks the query and a new one, which has met no image before.
  void check(ProximityQuery* query, const std::vector<Image>& images,
             const RegionOfInterest& region = {}) {
    std::vector<CloudSnapshot> snapshots(images.size());
    std::vector<const CloudSnapshot*> clouds;
    IngestConfig config;
    config.min_range = 0.0;
    for (std::size_t i = 0; i < images.size(); ++i) {
      Ingest ingest(config);
      ingest.set_region_of_interest(region);
      ingest.run(images[i].raw(), Eigen::Isometry3d::Identity(), {}, 0.0, &snapshots[i]);
      clouds.push_back(&snapshots[i]);
    }
    const SnapshotSpan span(clouds.data(), clouds.size());
    ProximityQuery other(model_, config_);
    std::vector<LinkProximity> results, fresh;
    query->run(X_FL_, {true, true}, span, &results);
    other.run(X_FL_, {true, true}, span, &fresh);
    for (std::size_t link = 0; link < results.size(); ++link) {
      const double exact = truth(link, images, region);
      ++answers_;
      ASSERT_EQ(results[link].state, fresh[link].state) << "step " << answers_;
      ASSERT_LE(results[link].lower_bound, exact + 1e-9) << "step " << answers_;
      if (region.radius < 1e3) continue;  // what is outside may be nearer
      ASSERT_GE(results[link].distance, exact - 1e-6) << "step " << answers_;
      ASSERT_LE(results[link].distance, exact + config_.tolerance + 2e-6) << "step " << answers_;
    }
    evaluations_ += query->statistics().exact_evaluations;
    fresh_evaluations_ += other.statistics().exact_evaluations;
  }

  void move(double step) {
    for (Eigen::Isometry3d& X : X_FL_) X.translation() += test::random_vector(&rng_, step);
  }

  static constexpr std::size_t kWidth = 48, kHeight = 32;
  test::Rng rng_{181};
  std::vector<TriangleMesh> meshes_;
  std::shared_ptr<RobotModel> model_;
  std::vector<Eigen::Isometry3d> X_FL_;
  QueryConfig config_;
  int answers_ = 0;
  std::uint64_t evaluations_ = 0, fresh_evaluations_ = 0;
};

// The very same image again, and again with new noise: right, and with hardly more exact distances
// than a query that knows nothing.
TEST_F(ImageToImage, StillScenes) {
  for (const double tolerance : {0.0, 1e-3}) {
    config_.tolerance = tolerance;
    for (const double noise : {0.0, 1e-4, 2e-3}) {
      ProximityQuery query(model_, config_);
      evaluations_ = fresh_evaluations_ = 0;
      for (int i = 0; i < 8; ++i) check(&query, {wall(kWidth, kHeight, noise, &rng_)});
      EXPECT_LT(evaluations_, 2 * fresh_evaluations_) << "noise " << noise;
    }
  }
}

// One new point, in front of the nearest one or inside the link, where the last image had nothing.
TEST_F(ImageToImage, OneNewPoint) {
  config_.tolerance = 1e-3;
  ProximityQuery query(model_, config_);
  for (int i = 0; i < 40; ++i) {
    Image image = wall(kWidth, kHeight, 1e-3, &rng_);
    check(&query, {image});
    const std::size_t link = static_cast<std::size_t>(i) % 2;
    const Eigen::Vector3d center = X_FL_[link].translation();
    const double away = i % 4 < 2 ? 0.02 : 0.12;
    image.at(rng_() % (kWidth * kHeight)) =
        (center + away * test::random_vector(&rng_, 1.0).normalized()).cast<float>();
    check(&query, {image});
    move(0.002);
  }
}

// Pixels change places, are cropped or lost, come as a list in any order, or from another source:
// the same key is another point's.
TEST_F(ImageToImage, OtherPointsUnderTheSameKeys) {
  config_.tolerance = 1e-3;
  ProximityQuery query(model_, config_);
  for (int i = 0; i < 60; ++i) {
    Image image = wall(kWidth, kHeight, 5e-4, &rng_);
    const std::size_t n = kWidth * kHeight;
    RegionOfInterest region;
    if (i % 6 == 1) {
      for (std::size_t k = 0; k < n / 2; ++k) image.at(k).swap(image.at(n - 1 - k));
    }
    if (i % 6 == 2) {
      for (std::size_t k = n - 1; k > 0; --k) image.at(k).swap(image.at(rng_() % (k + 1)));
      image.width = n;
      image.height = 1;
    }
    if (i % 6 == 3) {
      for (std::size_t k = 0; k < n; k += 1 + rng_() % 3) {
        image.at(k).setConstant(std::numeric_limits<float>::quiet_NaN());
      }
    }
    if (i % 6 == 4) region = {X_FL_[0].translation(), 0.35};
    std::vector<Image> images{image};
    if (i % 6 == 5) {
      images.insert(images.begin() + i % 2, wall(kWidth, kHeight, 0.0, &rng_));
      for (std::size_t k = 0; k < n; ++k) images[0].at(k).z() -= 0.03F;
    }
    check(&query, images, region);
    move(i % 5 == 0 ? 0.05 : 0.001);
  }
}

}  // namespace
}  // namespace ist
