// The share of a contact volume that is known when time ends the sum, at looks at the clock from
// the first to the last, beside the share of the complete sum.

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <functional>
#include <vector>

#include "internal/cloud/point_bvh.h"
#include "internal/proximity/deadline.h"
#include "ist_proximity/contact/contact_volume.h"
#include "support/box_oracle.h"
#include "support/contact_oracle.h"
#include "support/meshes.h"
#include "support/random_links.h"
#include "support/sanitizers.h"
#include "support/scene.h"

namespace ist {
namespace {

using test::ContactLink;
using test::one;
using Points = std::vector<Eigen::Vector3d>;
using Sum = std::function<ContactVolume(TimePoint)>;

struct Stopped {
  std::size_t stops = 0;   // at which a part of the volume was there
  std::size_t useful = 0;  // at which some share of it was known to be
};

// Ends a sum at every `stride`-th look at the clock until it finishes.
Stopped stop_everywhere(const Sum& sum, std::int64_t stride) {
  const TimePoint later = std::chrono::steady_clock::now() + std::chrono::hours(24);
  const ContactVolume whole = sum(TimePoint::max());
  EXPECT_EQ(whole.known, 1.0);
  Stopped result;
  double last_known = 0.0, last_volume = 0.0;
  for (std::int64_t looks = 0; looks < 1000000; looks += stride) {
    Deadline::asks_left_for_test = looks;
    const ContactVolume part = sum(later);
    const bool is_finished = Deadline::asks_left_for_test >= 0;
    Deadline::asks_left_for_test = -1;
    if (is_finished) {
      EXPECT_EQ(part.known, 1.0);
      EXPECT_EQ(part.volume, whole.volume);
      break;
    }
    EXPECT_LT(part.known, 1.0) << "after " << looks;
    EXPECT_GE(part.known, last_known) << "after " << looks;
    EXPECT_GE(part.volume, last_volume) << "after " << looks;
    EXPECT_LE(part.volume, whole.volume * (1.0 + 1e-6)) << "after " << looks;
    EXPECT_LE(part.known * whole.volume, part.volume) << "after " << looks;
    last_known = part.known;
    last_volume = part.volume;
    result.stops += part.volume > 0.0 ? 1 : 0;
    result.useful += part.known > 0.0 ? 1 : 0;
  }
  return result;
}

LinkGeometry any_link(test::Rng* rng, int seed) {
  const std::vector<LinkGeometry> links = test::random_links(rng);
  return links[static_cast<std::size_t>(seed) % links.size()];
}

// A patch of a surface with as many points as there may be.
Points patch(test::Rng* rng, std::size_t count, double size, double noise) {
  const Eigen::Isometry3d X = test::random_pose(rng, 0.1);
  Points points;
  for (std::size_t i = 0; i < count; ++i) {
    points.push_back(X * Eigen::Vector3d(test::uniform(rng, -size, size),
                                         test::uniform(rng, -size, size),
                                         test::uniform(rng, -noise, noise)));
  }
  return points;
}

CloudSnapshot random_map(test::Rng* rng) {
  std::vector<Eigen::AlignedBox3d> boxes;
  for (int i = 0; i < 40; ++i) {
    const Eigen::Vector3d corner = test::random_vector(rng, 0.15);
    const double size = std::pow(10.0, test::uniform(rng, -2.5, -0.8));
    boxes.emplace_back(corner, Eigen::Vector3d(corner.array() + size));
  }
  return test::make_map(boxes);
}

TEST(ContactKnown, NoMoreThanIsSummedOfCloudsAndMaps) {
  std::size_t stops = 0, useful = 0;
  for (int seed = 0; seed < test::scaled(24); ++seed) {
    test::Rng rng(700 + static_cast<unsigned>(seed));
    const ContactLink link(any_link(&rng, seed), 100, 0.01);
    const double cell = test::uniform(&rng, 0.004, 0.03);
    CloudSnapshot first = test::thinned(patch(&rng, 3000, 0.2, 0.05), cell);
    CloudSnapshot second = test::thinned(patch(&rng, 500, 0.1, 0.0), 0.01);
    if (seed % 3 == 0) first.boxes = random_map(&rng).boxes;
    const Eigen::Isometry3d X_FL = test::random_pose(&rng, 0.05);
    const bool is_fresh = seed % 2 == 0;
    const Stopped stopped = stop_everywhere(
        [&](TimePoint end) {
          if (is_fresh) first.index.bvh().set_thinning(first.thinning);
          return contact_volume(link.link(), *link.body, X_FL, {&first, &second}, end);
        },
        3 + 4 * (seed % 4));
    stops += stopped.stops;
    useful += stopped.useful;
  }
  EXPECT_GT(stops, 100U);
  EXPECT_GT(useful, stops / 2);
}

TEST(ContactKnown, NoMoreThanIsSummedOfTwoLinks) {
  std::size_t stops = 0, useful = 0;
  for (int seed = 0; seed < test::scaled(12); ++seed) {
    test::Rng rng(800 + static_cast<unsigned>(seed));
    const ContactLink a(any_link(&rng, seed), 50, 0.02);
    const ContactLink b(seed % 4 == 0 ? one(Sphere{0.07}) : one(Box{{0.1, 0.2, 0.15}}), 50, 0.02);
    const Eigen::Isometry3d X_AB = test::random_pose(&rng, 0.1);
    const Stopped stopped =
        stop_everywhere([&](TimePoint end) { return contact_volume(*a.body, *b.body, X_AB, end); },
                        3 + 2 * (seed % 3));
    stops += stopped.stops;
    useful += stopped.useful;
  }
  EXPECT_GT(stops, 100U);
  EXPECT_GT(useful, stops / 2);
}

// Two groups of balls that fill their links: sphere by sphere.
TEST(ContactKnown, NoMoreThanIsSummedOfBalls) {
  const auto balls = [](int count, double radius) {
    LinkGeometry geometry;
    for (int i = 0; i < count; ++i) {
      const Eigen::Isometry3d X(Eigen::Translation3d(0.1 * (i % 4), 0.1 * (i / 4), 0.0));
      geometry.push_back({Sphere{radius}, X, ""});
    }
    return geometry;
  };
  const ContactLink a(balls(16, 0.045)), b(balls(12, 0.03));
  test::Rng rng(9);
  for (int trial = 0; trial < test::scaled(20); ++trial) {
    const Eigen::Isometry3d X_AB = test::random_pose(&rng, 0.05);
    stop_everywhere([&](TimePoint end) { return contact_volume(*a.body, *b.body, X_AB, end); }, 1);
    // The field of several balls is no ball's: it turns with the link.
    const ContactVolume found = contact_volume(*a.body, *b.body, X_AB);
    const ContactVolume truth = test::oracle_contact(*a.body, *b.body, X_AB);
    ASSERT_LE((found.weighted_normal - truth.weighted_normal).norm(), 1e-4 * truth.volume);
  }
}

// More groups than there is room for: they are summed depth first, and the share stays sound.
TEST(ContactKnown, MoreSourcesThanRoom) {
  const ContactLink link(one(Box{{0.4, 0.4, 0.4}}), 50);
  test::Rng rng(3);
  const CloudSnapshot cloud = test::thinned(patch(&rng, 300, 0.15, 0.15), 0.02);
  std::vector<const CloudSnapshot*> clouds(1100, nullptr);
  const CloudSnapshot small = test::thinned({Eigen::Vector3d(0.01, 0.02, 0.03)});
  for (const CloudSnapshot*& each : clouds) each = &small;
  clouds.push_back(&cloud);
  const Stopped stopped = stop_everywhere(
      [&](TimePoint end) {
        return contact_volume(link.link(), *link.body, Eigen::Isometry3d::Identity(),
                              SnapshotSpan(clouds.data(), clouds.size()), end);
      },
      1499);
  EXPECT_GT(stopped.stops, 0U);
}

}  // namespace
}  // namespace ist
