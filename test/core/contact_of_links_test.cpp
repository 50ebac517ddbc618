// The volume that two links share, and its wrench, beside bodies with closed forms and beside dense
// sampling of the links' exact geometry.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "ist_proximity/contact/contact_volume.h"
#include "support/contact_oracle.h"
#include "support/meshes.h"
#include "support/random_links.h"
#include "support/sanitizers.h"
#include "support/shape_oracle.h"

namespace ist {
namespace {

using test::ContactLink;
using test::one;

constexpr double kPi = 3.14159265358979323846;

Eigen::Isometry3d at(const Eigen::Vector3d& p) {
  Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
  X.translation() = p;
  return X;
}

// Two balls: the lens of the balls themselves, and a force along the line of the centres, without a
// moment about it.
TEST(ContactOfLinks, BallsShareTheirLens) {
  const double R = 0.1, r = 0.06;
  const ContactLink a(one(Sphere{R})), b(one(Sphere{r}));
  for (const double depth : {0.005, 0.01, 0.02, 0.04, 0.08}) {
    const double d = R + r - depth;
    const double lens =
        kPi * depth * depth * (d * d + 2 * d * (R + r) - 3 * (R - r) * (R - r)) / (12.0 * d);
    const Eigen::Vector3d along = Eigen::Vector3d(1, 2, 2) / 3.0;
    const ContactVolume found = contact_volume(*a.body, *b.body, at(d * along));
    EXPECT_NEAR(found.volume / lens, 1.0, 0.02) << depth;
    EXPECT_GT(-found.weighted_normal.dot(along), 0.9 * found.volume) << depth;
    EXPECT_LT(found.weighted_normal.cross(along).norm(), 0.02 * found.volume) << depth;
    EXPECT_LT(found.weighted_moment.norm(), 0.02 * R * found.volume) << depth;
  }
}

// A box that stands in another one, from a hair to deep, few spheres and many: area times depth, a
// force along the face's normal that acts in the middle of the shared part; and the other box gets
// the opposite wrench. Inner spheres have 0.42 of this volume at 10 mm.
TEST(ContactOfLinks, BoxesShareAreaTimesDepth) {
  for (const int spheres : {50, 200}) {
    const ContactLink plate(one(Box{{0.3, 0.3, 0.1}}), spheres);
    const ContactLink post(one(Box{{0.1, 0.1, 0.3}}), spheres);
    for (const double depth : {0.0005, 0.002, 0.005, 0.01, 0.02, 0.04}) {
      const Eigen::Isometry3d X = at({0.05, -0.03, 0.05 + 0.15 - depth});
      const ContactVolume found = contact_volume(*plate.body, *post.body, X);
      const double truth = 0.1 * 0.1 * depth;
      EXPECT_NEAR(found.volume / truth, 1.0, 0.1) << depth;
      const Eigen::Vector3d n = found.weighted_normal / found.volume;
      EXPECT_LT(n.z(), -0.6) << depth;
      EXPECT_LT(n.head<2>().norm(), 0.1) << depth;
      // p x F with F along -z.
      const Eigen::Vector3d arm = found.weighted_moment / -found.weighted_normal.z();
      EXPECT_NEAR(arm.x(), 0.03, 0.01) << depth;
      EXPECT_NEAR(arm.y(), 0.05, 0.01) << depth;

      PenetrationConfig stiffness;
      const Wrench on_plate = contact_wrench(found, Eigen::Isometry3d::Identity(), stiffness);
      const Wrench on_post = reaction(on_plate, -X.translation());
      const ContactVolume back = contact_volume(*post.body, *plate.body, X.inverse());
      const Wrench same = contact_wrench(back, X, stiffness);
      EXPECT_NEAR(back.volume, found.volume, 1e-4 * found.volume);
      EXPECT_LT((same.force - on_post.force).norm(), 1e-3 * on_post.force.norm());
      EXPECT_LT((same.torque - on_post.torque).norm(), 1e-3 * on_post.force.norm() * 0.2);
    }
    // Apart there is none.
    EXPECT_EQ(contact_volume(*plate.body, *post.body, at({0.05, -0.03, 0.2001})).volume, 0.0);
  }
}

// A cylinder's cap in a box, and two crossed cylinders beside dense sampling, a few millimetres
// deep.
TEST(ContactOfLinks, CylindersShareWhatDenseSamplingCounts) {
  const LinkGeometry rod = one(Cylinder{0.05, 0.2}), block = one(Box{{0.3, 0.3, 0.1}});
  const ContactLink cylinder(rod), box(block);
  for (const double depth : {0.001, 0.005, 0.01, 0.03}) {
    const ContactVolume cap = contact_volume(*box.body, *cylinder.body, at({0, 0, 0.15 - depth}));
    EXPECT_NEAR(cap.volume / (kPi * 0.0025 * depth), 1.0, 0.1) << depth;
  }
  Eigen::Isometry3d X = at({0.1 - 0.01, 0, 0});  // axes cross at a right angle, 10 mm deep
  X.linear() = Eigen::AngleAxisd(0.5 * kPi, Eigen::Vector3d::UnitX()).matrix();
  constexpr int kAlong = 120;
  int both = 0;
  for (int i = 0; i < kAlong * kAlong * kAlong; ++i) {
    const Eigen::Array3d cell(i % kAlong, i / kAlong % kAlong, i / kAlong / kAlong);
    const Eigen::Vector3d p =
        Eigen::Vector3d(0.045, 0, 0) + 0.1 * ((cell + 0.5) / kAlong - 0.5).matrix();
    both += test::oracle_signed_distance(rod, p) < 0.0 &&
                    test::oracle_signed_distance(rod, X.inverse() * p) < 0.0
                ? 1
                : 0;
  }
  const double truth = both * std::pow(0.1 / kAlong, 3);
  ASSERT_GT(truth, 0.0);
  const ContactVolume found = contact_volume(*cylinder.body, *cylinder.body, X);
  EXPECT_NEAR(found.volume / truth, 1.0, 0.15);
  EXPECT_LT(found.weighted_normal.x(), -0.6 * found.volume);
  EXPECT_LT(found.weighted_normal.tail<2>().norm(), 0.05 * found.volume);
}

}  // namespace
}  // namespace ist
