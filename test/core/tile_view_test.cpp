#include "cloud/filters/tile_view.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "cloud/filters/self_filter.h"
#include "internal/geometry/ray_cast.h"
#include "ist_proximity/robot/robot_model.h"
#include "support/allocations.h"
#include "support/meshes.h"
#include "support/scene.h"

namespace ist {
namespace {

constexpr std::size_t kPixels = TileView::kPixels;
constexpr double kInf = std::numeric_limits<double>::infinity();

Eigen::Vector3d random_direction(std::mt19937_64* random) {
  std::normal_distribution<double> normal;
  return Eigen::Vector3d(normal(*random), normal(*random), normal(*random)).normalized();
}

// Where a ray first meets the link whose surface is nearest to the point; the first of equals.
TileView::Sight nearest_surface(const std::vector<const SelfFilter::Link*>& links,
                                const std::vector<Eigen::Isometry3d>& X_LS,
                                const Eigen::Vector3d& direction, double range, double behind) {
  TileView::Sight nearest;
  for (const SelfFilter::Link* link : links) {
    const Eigen::Isometry3d& X = X_LS[link->number];
    const RayHit hit =
        ray_cast(*link->solid, X.translation(), X.linear() * direction, range + behind);
    if (!(std::abs(hit.t - range) < std::abs(nearest.t - range))) continue;
    nearest = {hit.t, X.linear().transpose() * hit.normal, link};
  }
  return nearest;
}

// Bodies about a place 1 m away, and the first of them once more.
std::vector<PosedSolid> random_solids(const std::vector<LinkModel>& bodies,
                                      std::mt19937_64* random) {
  std::uniform_real_distribution<double> u(-1.0, 1.0);
  std::vector<PosedSolid> solids;
  for (std::size_t i = 0; i <= bodies.size(); ++i) {
    const LinkModel& body = bodies[i % bodies.size()];
    Eigen::Isometry3d X_FL(Eigen::AngleAxisd(3.0 * u(*random), random_direction(random)));
    X_FL.translation() = Eigen::Vector3d(0.0, 0.0, 1.0) + 0.12 * random_direction(random);
    solids.push_back({&body.tree, &body.solid, X_FL});
  }
  solids.back().X_FL = solids.front().X_FL;
  return solids;
}

// Points with noise on what is seen first, before it, or on a wall.
std::array<float, 3 * kPixels> random_points(const std::vector<const SelfFilter::Link*>& links,
                                             const std::vector<Eigen::Isometry3d>& X_LS,
                                             double noise, std::mt19937_64* random) {
  std::uniform_real_distribution<double> u(-1.0, 1.0);
  const Eigen::Vector3d aim = Eigen::Vector3d(0.25 * u(*random), 0.25 * u(*random), 1.0);
  constexpr double kApart = 0.003;
  std::array<float, 3 * kPixels> xyz;
  for (std::size_t k = 0; k < kPixels; ++k) {
    const Eigen::Vector3d pixel(static_cast<double>(k % kTileSide),
                                static_cast<double>(k / kTileSide), 0.0);
    const Eigen::Vector3d d = (aim + kApart * pixel).normalized();
    double t = 1.6;
    for (const SelfFilter::Link* link : links) {
      const Eigen::Isometry3d& X = X_LS[link->number];
      t = std::min(t, ray_cast(*link->solid, X.translation(), X.linear() * d, kInf).t);
    }
    const Eigen::Vector3f p = ((t + noise * u(*random)) * d).cast<float>();
    std::copy(p.data(), p.data() + 3, xyz.begin() + static_cast<std::ptrdiff_t>(3 * k));
  }
  return xyz;
}

// Links that overlap, one of them twice in the same place, and points on, beside and between them:
// the sights are those of all links, whichever link is looked at first, and however many rays at a
// time.
TEST(TileView, SightsAreThoseOfAllLinksInAnyOrder) {
  const auto model = test::make_model({test::icosphere(0.1, 4), Box{{0.15, 0.1, 0.1}},
                                       test::torus(0.12, 0.04, 48, 24), Cylinder{0.05, 0.3}},
                                      0.01);
  const std::vector<LinkModel>& bodies = model->links;
  std::mt19937_64 random(7);
  TileView view;
  view.reserve(bodies.size() + 1);
  int hits = 0, misses = 0, equal = 0;
  for (int scene = 0; scene < 3000; ++scene) {
    const std::vector<PosedSolid> solids = random_solids(bodies, &random);
    SelfFilter filter;
    filter.set_poses(solids, Eigen::Isometry3d::Identity(), 0.02);
    PaddedBox everything;
    everything.min = Eigen::Array4f(-3.0F, -3.0F, -3.0F, 0.0F);
    everything.max = Eigen::Array4f(3.0F, 3.0F, 3.0F, 0.0F);
    ASSERT_TRUE(filter.begin_group(everything));
    std::vector<const SelfFilter::Link*> links = filter.group();
    ASSERT_EQ(links.size(), solids.size());
    std::vector<Eigen::Isometry3d> X_LS;
    for (const PosedSolid& posed : solids) X_LS.push_back(posed.X_FL.inverse());

    const double noise = scene % 3 == 0 ? 0.0 : 0.02;
    const std::array<float, 3 * kPixels> xyz = random_points(links, X_LS, noise, &random);
    const std::uint32_t kept = scene % 2 == 0 ? 0xFFFFU : (random() & 0xFFFFU) | 1U;
    const std::uint32_t early = random() & kept;
    const double behind = 0.05;
    const std::vector<const SelfFilter::Link*> sorted = links;
    std::shuffle(links.begin(), links.end(), random);

    const RawCloud cloud = packed_cloud(xyz.data(), kTileSide, kTileSide);
    const long before = test::allocations;
    view.read(cloud, 0, 0, kept);
    view.begin(behind);
    for (const SelfFilter::Link* link : links) view.add_link(*link, X_LS[link->number]);
    view.look_at(early);
    view.look_at(kept);
    ASSERT_EQ(test::allocations, before);
    for (std::size_t k = 0; k < kPixels; ++k) {
      if (!view.is_kept(k)) continue;
      const TileView::Sight& sight = view.sight(k);
      const TileView::Sight truth =
          nearest_surface(sorted, X_LS, view.direction(k), view.range(k), behind);
      ASSERT_EQ(sight.link, truth.link) << "scene " << scene << ", pixel " << k;
      ASSERT_EQ(sight.t, truth.t);
      ASSERT_EQ(sight.normal, truth.normal);
      (truth.link != nullptr ? hits : misses) += 1;
      equal += truth.link == sorted.front() ? 1 : 0;
    }
  }
  EXPECT_GT(hits, 10000);
  EXPECT_GT(misses, 3000);
  EXPECT_GT(equal, 1000);
}

}  // namespace
}  // namespace ist
