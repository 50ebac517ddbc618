#include "ist_proximity/contact/contact_volume.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "ist_proximity/proximity/proximity_query.h"
#include "support/allocations.h"
#include "support/box_oracle.h"
#include "support/contact_oracle.h"
#include "support/meshes.h"
#include "support/random_links.h"
#include "support/sanitizers.h"

namespace ist {
namespace {

using test::ContactLink;
using test::one;
using Points = std::vector<Eigen::Vector3d>;

// The error of float, relative to the contact volume and to the sphere of one point. It is largest
// in the depth of points just below the surface.
constexpr double kRounding = 5e-5, kSphere = 2e-6;

void expect_same(const ContactVolume& found, const ContactVolume& truth, double size) {
  const double scale = truth.volume + kSphere;
  EXPECT_NEAR(found.volume, truth.volume, kRounding * scale);
  EXPECT_LT((found.weighted_normal - truth.weighted_normal).norm(), kRounding * scale);
  EXPECT_LT((found.weighted_moment - truth.weighted_moment).norm(), kRounding * scale * size);
}

Points wall(double half, double spacing, double z) {
  Points points;
  for (double x = -half; x <= half; x += spacing) {
    for (double y = -half; y <= half; y += spacing) points.emplace_back(x, y, z);
  }
  return points;
}

std::vector<ContactLink> some_links() {
  std::vector<ContactLink> links;
  test::Rng rng(7);
  for (const LinkGeometry& geometry :
       {one(Box{{0.2, 0.1, 0.05}}), one(Cylinder{0.05, 0.2}), one(Sphere{0.1}),
        one(test::l_shape(0.2, 0.04)), one(test::torus(0.1, 0.03, 10, 6)),
        test::random_compound(&rng), one(test::open_box({0.1, 0.1, 0.1}))}) {
    links.emplace_back(geometry);
  }
  return links;
}

TEST(ContactVolume, IsThatOfBruteForceOnRandomScenes) {
  test::Rng rng(101);
  int in_contact = 0;
  for (const ContactLink& link : some_links()) {
    for (int i = 0; i < test::scaled(40); ++i) {
      // Two sources, which may overlap, are thinned separately.
      Points points = test::random_points(&rng, link.geometry, 400);
      const CloudSnapshot first = test::thinned(points, test::uniform(&rng, 0.005, 0.02));
      for (Eigen::Vector3d& p : points) p += test::random_vector(&rng, 0.005);
      const CloudSnapshot second = test::thinned(points, 0.01);
      const Eigen::Isometry3d X_FL = test::random_pose(&rng, 0.1);
      const ContactVolume found = contact_volume(link.link(), *link.body, X_FL, {&first, &second});
      expect_same(found, test::oracle_contact(link.link(), *link.body, X_FL, {&first, &second}),
                  0.3);
      if (found.volume > 0.0) ++in_contact;
    }
  }
  EXPECT_GT(in_contact, test::scaled(60));
}

TEST(ContactVolume, IsTheSameFarFromTheOrigin) {
  const ContactLink link(one(Box{{0.2, 0.1, 0.05}}));
  const Eigen::Vector3d far(433000.0, 5411000.0, 110.0);  // map coordinates
  const CloudSnapshot near_cloud = test::thinned(wall(0.2, 0.003, 0.0));
  const CloudSnapshot far_cloud = test::thinned(wall(0.2, 0.003, 0.0), 0.01, far);
  Eigen::Isometry3d X_FL(Eigen::Translation3d(0.01, 0.02, 0.01));
  const ContactVolume here = contact_volume(link.link(), *link.body, X_FL, {&near_cloud});
  X_FL.translation() += far;
  const ContactVolume there = contact_volume(link.link(), *link.body, X_FL, {&far_cloud});
  expect_same(there, test::oracle_contact(link.link(), *link.body, X_FL, {&far_cloud}), 0.3);
  EXPECT_GT(here.volume, 0.0);
  // Map coordinates in double are rounded to a nanometre, so some points change cells.
  EXPECT_NEAR(there.volume, here.volume, 0.02 * here.volume);
  EXPECT_LT((there.weighted_normal - here.weighted_normal).norm(), 0.02 * here.volume);
}

TEST(ContactVolume, OfTwoLinksIsThatOfBruteForce) {
  test::Rng rng(102);
  const std::vector<ContactLink> links = some_links();
  for (std::size_t a = 0; a < links.size(); ++a) {
    for (std::size_t b = 0; b < links.size(); ++b) {
      const Eigen::Isometry3d X_AB = test::random_pose(&rng, 0.06);
      const ContactVolume found = contact_volume(*links[a].body, *links[b].body, X_AB);
      expect_same(found, test::oracle_contact(*links[a].body, *links[b].body, X_AB), 0.3);
      // Action equals reaction.
      const ContactVolume back = contact_volume(*links[b].body, *links[a].body, X_AB.inverse());
      EXPECT_NEAR(back.volume, found.volume, kRounding * found.volume + 1e-12);
      EXPECT_LT((X_AB.linear() * back.weighted_normal + found.weighted_normal).norm(),
                kRounding * found.volume + 1e-12);
    }
  }
}

TEST(ContactVolume, CountsNothingTwice) {
  const ContactLink link(one(Box{{0.2, 0.15, 0.1}}));
  const Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();
  const CloudSnapshot once = test::thinned(wall(0.2, 0.002, 0.02));
  const double volume = contact_volume(link.link(), *link.body, X_FL, {&once}).volume;
  ASSERT_GT(volume, 0.0);
  // A second camera delivers the same points.
  EXPECT_NEAR(contact_volume(link.link(), *link.body, X_FL, {&once, &once}).volume, volume,
              1e-6 * volume);
  // No more than the union of all spheres within the link: the wall's layer.
  const double layer = 2.0 * kPointSphereRadius * once.thinning;
  EXPECT_LT(volume, 0.2 * 0.15 * layer);
  EXPECT_GT(volume, 0.5 * 0.2 * 0.15 * layer);
}

TEST(ContactVolume, DependsLittleOnTheDensityOfTheCloud) {
  const ContactLink link(one(Box{{0.2, 0.15, 0.1}}));
  Eigen::Isometry3d X_FL(Eigen::AngleAxisd(0.6, Eigen::Vector3d(1, 2, 0.5).normalized()));
  X_FL.translation() = Eigen::Vector3d(0.01, 0.0, 0.02);
  const auto volume = [&](double spacing) {
    const CloudSnapshot cloud = test::thinned(wall(0.25, spacing, 0.0));
    return contact_volume(link.link(), *link.body, X_FL, {&cloud});
  };
  const ContactVolume base = volume(0.002);
  // Fewer and larger spheres weigh the same points less evenly.
  const double allowed = test::kSanitized ? 0.1 : 0.05;
  for (const double spacing : {0.001, 0.0014, 0.0028, 0.004}) {
    const ContactVolume other = volume(spacing);
    EXPECT_NEAR(other.volume, base.volume, allowed * base.volume) << spacing;
    EXPECT_LT((other.weighted_normal - base.weighted_normal).norm(),
              allowed * base.weighted_normal.norm())
        << spacing;
  }
}

TEST(ContactVolume, IsZeroUnlessPointsAreInside) {
  test::Rng rng(103);
  std::vector<LinkProximity> results;
  int outside = 0;
  for (const ContactLink& link : some_links()) {
    if (!link.link().solid.is_closed()) continue;
    ProximityQuery query(link.model, {});
    for (int i = 0; i < test::scaled(60); ++i) {
      const CloudSnapshot cloud =
          test::thinned(test::random_points(&rng, link.geometry, 1 + i % 20));
      const Eigen::Isometry3d X_FL = test::random_pose(&rng, 0.15);
      query.run({X_FL}, {true}, {&cloud}, &results);
      if (results[0].state == LinkState::kContact) continue;
      ++outside;
      EXPECT_EQ(contact_volume(link.link(), *link.body, X_FL, {&cloud}).volume, 0.0);
    }
  }
  EXPECT_GT(outside, test::scaled(50));
}

TEST(ContactVolume, PushesOutOfAWall) {
  const ContactLink link(one(Box{{0.2, 0.15, 0.1}}));
  const CloudSnapshot cloud = test::thinned(wall(0.2, 0.003, 0.0));
  for (const double depth : {0.005, 0.01, 0.02, 0.03}) {
    const Eigen::Isometry3d X_FL(Eigen::Translation3d(0.0, 0.0, 0.05 - depth));
    const ContactVolume found = contact_volume(link.link(), *link.body, X_FL, {&cloud});
    EXPECT_GT(found.weighted_normal.normalized().z(), 0.99) << depth;
    EXPECT_LE(found.weighted_normal.norm(), found.volume);
    // A symmetric wall exerts no moment.
    EXPECT_LT(found.weighted_moment.norm(), 0.01 * found.volume);
  }
}

TEST(ContactVolume, HasAMomentWhenALinkIsHitAtItsEnd) {
  const ContactLink link(one(Box{{0.2, 0.04, 0.04}}));
  Points points;
  for (const Eigen::Vector3d& p : wall(0.02, 0.003, -0.012)) {
    points.emplace_back(p.x() + 0.08, p.y(), p.z());
  }
  const CloudSnapshot cloud = test::thinned(points);
  const ContactVolume found =
      contact_volume(link.link(), *link.body, Eigen::Isometry3d::Identity(), {&cloud});
  EXPECT_GT(found.weighted_normal.z(), 0.0);
  EXPECT_NEAR(found.weighted_moment.y(), -0.08 * found.weighted_normal.z(),
              0.02 * found.weighted_normal.z());
}

// Dividing a box of a map into cells does not change its volume.
TEST(ContactVolume, OfAMapIsThatOfItsBoxes) {
  const ContactLink link(one(Box{{0.2, 0.2, 0.2}}), 500);
  test::Rng rng(104);
  for (const double edge : {0.05, 0.1}) {
    const Eigen::Vector3d low(-0.03, -0.04, -0.02);
    const CloudSnapshot map = test::make_map({{low, low + Eigen::Vector3d::Constant(edge)}},
                                             test::random_pose(&rng, 1.0));
    Eigen::Isometry3d X_FL = map.X_FM;
    const double full = std::pow(edge, 3);
    const ContactVolume inside = contact_volume(link.link(), *link.body, X_FL, {&map});
    EXPECT_NEAR(inside.volume, full, 0.12 * full) << edge;
    // Half of the box is in the link.
    X_FL.translation() += X_FL.linear() * Eigen::Vector3d(0.1 + low.x() + 0.5 * edge, 0, 0);
    const ContactVolume half = contact_volume(link.link(), *link.body, X_FL, {&map});
    EXPECT_NEAR(half.volume, 0.5 * full, 0.25 * full) << edge;
    EXPECT_GT(
        (map.X_FM.linear().transpose() * X_FL.linear() * half.weighted_normal).normalized().x(),
        0.75);
    // The box is beside the link.
    X_FL.translation() += X_FL.linear() * Eigen::Vector3d(edge, 0, 0);
    EXPECT_EQ(contact_volume(link.link(), *link.body, X_FL, {&map}).volume, 0.0);
  }
}

TEST(ContactVolume, AllocatesNothing) {
  const ContactLink link(one(Box{{0.2, 0.15, 0.1}}));
  const CloudSnapshot cloud = test::thinned(wall(0.2, 0.003, 0.02));
  const std::vector<const CloudSnapshot*> clouds = {&cloud};
  const long before = test::allocations;
  const ContactVolume found =
      contact_volume(link.link(), *link.body, Eigen::Isometry3d::Identity(), clouds);
  const ContactVolume self = contact_volume(*link.body, *link.body, Eigen::Isometry3d::Identity());
  EXPECT_EQ(test::allocations, before);
  EXPECT_GT(found.volume, 0.0);
  EXPECT_GT(self.volume, 0.0);
}

}  // namespace
}  // namespace ist
