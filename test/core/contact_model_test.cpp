#include "ist_proximity/contact/contact_model.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include "support/contact_oracle.h"
#include "support/meshes.h"
#include "support/random_links.h"
#include "support/temp_dir.h"

namespace ist {
namespace {

using test::ContactLink;
using test::one;

double counted(const ContactGeometry& body) {
  double volume = 0.0;
  for (const test::OracleSphere& sphere : test::spheres_of(body)) {
    volume += sphere.cell_ratio * 4.0 * M_PI / 3.0 * std::pow(sphere.radius, 3);
  }
  return volume;
}

TEST(ContactGeometry, StandsForTheLinksVolume) {
  struct Case {
    LinkGeometry geometry;
    double volume;
  };
  LinkGeometry overlapping = one(Box{{0.2, 0.1, 0.1}});
  overlapping.push_back(overlapping[0]);
  overlapping[1].X_LE.translation().x() = 0.1;  // half of it in the other one
  for (const Case& one_case :
       {Case{one(Box{{0.2, 0.1, 0.05}}), 0.001}, Case{one(Sphere{0.1}), M_PI * 4e-3 / 3.0},
        Case{one(Cylinder{0.05, 0.2}), M_PI * 0.0025 * 0.2},
        Case{one(test::l_shape(0.2, 0.04)), test::signed_volume(test::l_shape(0.2, 0.04))},
        Case{one(test::torus(0.1, 0.03, 16, 10)),
             test::signed_volume(test::torus(0.1, 0.03, 16, 10))},
        Case{overlapping, 0.003}}) {
    for (const int spheres : {50, 300}) {
      const ContactLink link(one_case.geometry, spheres);
      EXPECT_NEAR(link.body->volume, one_case.volume, 0.03 * one_case.volume);
      EXPECT_NEAR(counted(*link.body), link.body->volume, 1e-3 * one_case.volume);
      EXPECT_LE(link.body->packed_volume, link.body->volume * (1.0 + 1e-12));
      EXPECT_LE(link.body->sphere_count, static_cast<std::size_t>(spheres));
      EXPECT_TRUE(link.body->note.empty()) << link.body->note;
    }
  }
}

TEST(ContactGeometry, OutwardFieldPointsToTheNearestSide) {
  const ContactLink link(one(Box{{0.2, 0.15, 0.1}}));
  int near_a_side = 0;
  for (const test::OracleSphere& sphere : test::spheres_of(*link.body)) {
    const Eigen::Vector3d outward = sphere.outward_at(sphere.center);
    EXPECT_LT(outward.norm(), 1.0);
    // The point is close to the top, and all other sides are farther.
    const double depth = 0.05 - sphere.center.z();
    const bool alone =
        depth < 0.01 && std::abs(sphere.center.x()) < 0.06 && std::abs(sphere.center.y()) < 0.04;
    if (!alone) continue;
    ++near_a_side;
    EXPECT_GT(outward.normalized().z(), 0.97);
    EXPECT_GT(outward.norm(), 0.9);
  }
  EXPECT_GT(near_a_side, 0);
  // All sides are equally near to the middle.
  const ContactLink sphere(one(Sphere{0.1}), 1);
  const auto spheres = test::spheres_of(*sphere.body);
  ASSERT_EQ(spheres.size(), 1U);
  EXPECT_LT(spheres[0].outward_at(Eigen::Vector3d::Zero()).norm(), 0.01);
  for (const Eigen::Vector3d& u : {Eigen::Vector3d(0.07, 0, 0), Eigen::Vector3d(0, -0.05, 0.05)}) {
    EXPECT_GT(spheres[0].outward_at(u).dot(u.normalized()), 0.9);
  }
}

TEST(ContactGeometry, OfALinkWithoutVolumeHasANote) {
  const ContactLink link(one(test::sheet(0.2)));
  EXPECT_FALSE(link.body->has_volume());
  EXPECT_NE(link.body->note.find("no volume"), std::string::npos);
  const CloudSnapshot cloud = test::thinned({{0.01, 0.02, 0.0}, {0.0, 0.0, 0.001}});
  EXPECT_EQ(contact_volume(link.link(), *link.body, Eigen::Isometry3d::Identity(), {&cloud}).volume,
            0.0);
  EXPECT_EQ(contact_volume(*link.body, *link.body, Eigen::Isometry3d::Identity()).volume, 0.0);
}

TEST(ContactGeometry, ComesFromTheCacheTheNextTime) {
  const test::TempDir directory;
  const LinkGeometry geometry = one(test::box({0.2, 0.1, 0.05}));
  const auto model = test::model_of({geometry}, 0.005);
  ContactConfig config;
  config.packing.max_spheres = 50;
  const auto build = [&] {
    return build_contact_geometry(geometry, 0, model->links[0], config, directory.path());
  };
  const auto first = build(), second = build();
  EXPECT_FALSE(first->from_cache);
  EXPECT_TRUE(second->from_cache);
  const auto a = test::spheres_of(*first), b = test::spheres_of(*second);
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].center, b[i].center);
    EXPECT_EQ(a[i].cell_ratio, b[i].cell_ratio);
    EXPECT_EQ(a[i].gradient, b[i].gradient);
  }
  config.packing.max_spheres = 51;
  EXPECT_FALSE(build()->from_cache);
}

TEST(ContactGeometry, IsNullWhenItWasCancelled) {
  const LinkGeometry geometry = one(test::box({0.2, 0.1, 0.05}));
  const auto model = test::model_of({geometry}, 0.005);
  EXPECT_EQ(build_contact_geometry(geometry, 0, model->links[0], {}, "", [] { return true; }),
            nullptr);
}

// A disjoint part of the packing for distances replaces a packing that takes too long.
TEST(ContactGeometry, FallsBackToThePackingForDistancesAfterTheTimeLimit) {
  const LinkGeometry geometry = one(test::open_box({0.2, 0.1, 0.05}));
  const auto model = test::model_of({geometry}, 0.005);
  ContactConfig config;
  config.time_limit = 1e-6;
  const auto body = build_contact_geometry(geometry, 0, model->links[0], config, "");
  EXPECT_FALSE(body->note.empty());
  EXPECT_NEAR(body->volume, 0.001, 0.1 * 0.001);
  const auto spheres = test::spheres_of(*body);
  EXPECT_GT(spheres.size(), 3U);
  for (std::size_t i = 0; i < spheres.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      EXPECT_GE((spheres[i].center - spheres[j].center).norm(),
                spheres[i].radius + spheres[j].radius - 1e-6);
    }
  }
}

TEST(ContactGeometry, HasAKeyOfEverythingThatChangesIt) {
  LinkGeometry geometry = one(Box{{0.2, 0.1, 0.05}});
  ContactConfig config;
  const std::string key = contact_geometry_key(geometry, 0, config);
  EXPECT_EQ(contact_geometry_key(one(Box{{0.2, 0.1, 0.05}}), 0, config), key);
  config.packing.max_spheres = 99;
  EXPECT_NE(contact_geometry_key(geometry, 0, config), key);
  config = {};
  geometry[0].X_LE.translation().x() = 1e-9;
  EXPECT_NE(contact_geometry_key(geometry, 0, config), key);
  EXPECT_NE(contact_geometry_key(one(Box{{0.2, 0.1, 0.06}}), 0, config), key);
}

TEST(ContactModel, KnowsTheRobotThatItBelongsTo) {
  const ContactLink link(one(Sphere{0.1}), 1), other(one(Sphere{0.1}), 1);
  ContactModel contacts{link.model, {nullptr}};
  EXPECT_EQ(find_contact_geometry(nullptr, *link.model, 0), nullptr);
  EXPECT_EQ(find_contact_geometry(&contacts, *link.model, 0), nullptr);
  contacts.links[0] = link.body;
  EXPECT_EQ(find_contact_geometry(&contacts, *link.model, 0), link.body.get());
  EXPECT_EQ(find_contact_geometry(&contacts, *other.model, 0), nullptr);
}

}  // namespace
}  // namespace ist
