// The volume that two links share, and its wrench, beside bodies with closed forms and beside dense
// sampling of the links' exact geometry.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "internal/geometry/mesh_io.h"
#include "internal/geometry/triangle_bvh.h"
#include "ist_proximity/contact/contact_volume.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "support/contact_oracle.h"
#include "support/data_dir.h"
#include "support/meshes.h"
#include "support/oracle.h"
#include "support/random_links.h"
#include "support/sanitizers.h"
#include "support/scene.h"
#include "support/shape_oracle.h"
#include "support/trial.h"
#include "support/truth.h"

namespace ist {
namespace {

using test::ContactLink;
using test::one;

constexpr double kPi = 3.14159265358979323846;

Eigen::Isometry3d at(const Eigen::Vector3d& p) {
  return Eigen::Isometry3d(Eigen::Translation3d(p));
}

// Two balls: the lens of the balls themselves, and a force along the line of the centres, without a
// moment about it.
TEST(ContactOfLinks, BallsShareTheirLens) {
  const double R = 0.1, r = 0.06;
  const ContactLink a(one(Sphere{R})), b(one(Sphere{r}));
  for (const double depth : {0.005, 0.01, 0.02, 0.04, 0.08}) {
    const double d = R + r - depth;
    const double lens = test::oracle_lens(R, r, d);
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

LinkProximity answer(LinkState state, double distance, double lower_bound) {
  LinkProximity proximity;
  proximity.state = state;
  proximity.distance = distance;
  proximity.lower_bound = lower_bound;
  return proximity;
}

bool is_unknown(const Wrench& wrench) {
  return wrench.force.array().isNaN().all() && wrench.torque.array().isNaN().all();
}

bool is_zero(const Wrench& wrench) { return wrench.force.isZero(0.0) && wrench.torque.isZero(0.0); }

TEST(Penetration, IsTheVolumeTimesTheStiffnessInTheFixedFrame) {
  test::Rng rng(31);
  ContactVolume volume;
  volume.volume = 2e-3;
  volume.weighted_normal = Eigen::Vector3d(1e-3, -2e-4, 5e-4);
  volume.weighted_moment = Eigen::Vector3d(-1e-5, 3e-5, 2e-5);
  const Eigen::Isometry3d X_FL = test::random_pose(&rng, 1.0);
  const PenetrationConfig config{5e4};
  const Wrench wrench =
      penetration_wrench(answer(LinkState::kContact, -0.01, -0.011), {}, &volume, X_FL, config);
  EXPECT_LT((wrench.force - 5e4 * (X_FL.linear() * volume.weighted_normal)).norm(), 1e-9);
  // The torque is about the link's origin at any pose.
  EXPECT_LT((wrench.torque - 5e4 * (X_FL.linear() * volume.weighted_moment)).norm(), 1e-9);
}

TEST(Penetration, IsZeroApartAndNaNWhenItIsNotKnown) {
  const ContactVolume volume{1e-3, Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY(), 1};
  const auto wrench = [](const LinkProximity& proximity, const ContactVolume* contact) {
    QueryConfig query;
    query.margin = 0.02;
    return penetration_wrench(proximity, query, contact, Eigen::Isometry3d::Identity(), {});
  };
  EXPECT_TRUE(is_unknown(wrench(LinkProximity(), &volume)));
  EXPECT_TRUE(is_zero(wrench(answer(LinkState::kClear, INFINITY, 1.0), nullptr)));
  EXPECT_TRUE(is_zero(wrench(answer(LinkState::kNear, 0.01, 0.009), nullptr)));
  // The margin was subtracted from a bound that holds without it.
  EXPECT_TRUE(is_zero(wrench(answer(LinkState::kNear, 0.001, -0.0199), nullptr)));
  // A deadline passed before it was known whether points are inside.
  EXPECT_TRUE(is_unknown(wrench(answer(LinkState::kNear, 0.01, -0.15), nullptr)));
  // The disjoint packing is not built yet.
  EXPECT_TRUE(is_unknown(wrench(answer(LinkState::kContact, -0.01, -0.011), nullptr)));
}

TEST(Penetration, ReactionIsTheSameForceAboutTheOtherOrigin) {
  test::Rng rng(32);
  for (int i = 0; i < 20; ++i) {
    const Eigen::Vector3d p_FA = test::random_vector(&rng, 1.0),
                          p_FB = test::random_vector(&rng, 1), p_F = test::random_vector(&rng, 1.0),
                          f = test::random_vector(&rng, 1.0);
    const Wrench on_first{f, (p_F - p_FA).cross(f)};
    const Wrench on_second = reaction(on_first, p_FA - p_FB);
    EXPECT_LT((on_second.force + f).norm(), 1e-12);
    EXPECT_LT((on_second.torque + (p_F - p_FB).cross(f)).norm(), 1e-12);
  }
}

// Signed depth in every contact of the test data: a robot's real meshes, which have holes, pushed
// into depth images. The truth comes from measuring every point in the link's box.

constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct LinkTruth {
  TriangleMesh mesh;
  TriangleBvh bvh;
};

std::vector<LinkTruth> panda_meshes(const std::filesystem::path& data) {
  std::vector<LinkTruth> links;
  for (std::size_t i = 0; i < test::kPandaLinks; ++i) {
    const auto file = data / "robots/franka_description/meshes/visual" /
                      (std::string(test::panda_mesh(i)) + ".dae");
    TriangleMesh mesh = load_mesh(file.string());
    TriangleBvh bvh(mesh);
    links.push_back({std::move(mesh), std::move(bvh)});
  }
  return links;
}

// The file's poses are rounded to float, but the witness identity holds for rotations only.
std::vector<Eigen::Isometry3d> rotations(std::vector<Eigen::Isometry3d> poses) {
  for (Eigen::Isometry3d& X : poses) {
    X.linear() = Eigen::Quaterniond(X.linear()).normalized().toRotationMatrix();
  }
  return poses;
}

// The smallest signed distance of the points inside; inf when there are none. No bound but the box
// is used. One result in twenty is checked triangle by triangle.
double deepest(const LinkTruth& link, const Eigen::Isometry3d& X_FL,
               const std::vector<Eigen::Vector3d>& points_F, std::size_t* checked) {
  const Eigen::Isometry3d X_LF = X_FL.inverse();
  double depth = kInfinity;
  Eigen::Vector3d witness = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p_F : points_F) {
    const Eigen::Vector3d p_L = X_LF * p_F;
    if (!link.bvh.bounds().contains(p_L)) continue;
    const double distance = -std::sqrt(link.bvh.closest(p_L).distance_sq);
    if (distance >= depth || !(link.bvh.winding_number(p_L) > 0.5)) continue;
    depth = distance;
    witness = p_L;
  }
  if (depth < kInfinity && ++*checked % 20 == 0) {
    // The two winding numbers must agree, so that they decide alike unless they are nearly 0.5.
    const double w = test::oracle_winding(link.mesh, witness);
    EXPECT_NEAR(link.bvh.winding_number(witness), w, 0.01);
    EXPECT_NEAR(test::oracle_distance(link.mesh, witness), -depth, 1e-9);
  }
  return depth;
}

TEST(ContactDepth, EqualsTheTruthInEveryContact) {
  const auto data = test::data_dir();
  if (!data) GTEST_SKIP() << test::kNoData;
  const std::vector<LinkTruth> meshes = panda_meshes(*data);
  const auto model = test::panda_model(*data, 0.005);
  const std::vector<bool> known(test::kPandaLinks, true);
  std::size_t contacts = 0, checked = 0;
  for (const char* name : {"mosd0", "mosd10", "mosd40"}) {
    const CloudSnapshot cloud = test::truth_cloud(*data, name);
    const std::vector<Eigen::Vector3d> points = test::stored_points(cloud.index);
    for (const char* motion : {"traj", "rand"}) {
      const std::vector<test::TruthCase> cases = test::truth_cases(*data, name, motion);
      QueryConfig exact, coarse;
      exact.max_distance = coarse.max_distance = 10.0;
      exact.tolerance = 0.0;
      coarse.tolerance = 0.005;
      ProximityQuery exact_query(model, exact), coarse_query(model, coarse);
      std::vector<LinkProximity> results, coarse_results;
      for (std::size_t c = 0; c < cases.size(); c += test::kStride) {
        const std::vector<Eigen::Isometry3d> X_FL = rotations(cases[c].X_FL);
        exact_query.run(X_FL, known, {&cloud}, &results);
        coarse_query.run(X_FL, known, {&cloud}, &coarse_results);
        for (std::size_t i = 0; i < results.size(); ++i) {
          if (cases[c].links[i].points_inside == 0) continue;
          SCOPED_TRACE(::testing::Message() << name << " " << motion << " " << c << " link " << i);
          ++contacts;
          const double truth = deepest(meshes[i], X_FL[i], points, &checked);
          const double rounding = std::abs(truth) < 2e-8 ? 2e-8 : 0.0;
          EXPECT_NEAR(results[i].distance, truth, 1e-5);
          EXPECT_LE(results[i].lower_bound, truth + rounding);
          EXPECT_LE(coarse_results[i].lower_bound, truth + rounding);
          EXPECT_GE(coarse_results[i].distance, truth - 1e-9);
          test::expect_witness(results[i], X_FL[i]);
        }
      }
    }
  }
  EXPECT_GT(contacts, test::kSanitized ? 30U : 600U);
}

}  // namespace
}  // namespace ist
