// What link against link builds for each link ends soon after it is cancelled.

#include <gtest/gtest.h>
#include <time.h>

#include <algorithm>
#include <cstdint>
#include <vector>

#include "internal/geometry/cancelled.h"
#include "ist_proximity/proximity/self_query.h"
#include "proximity/link_surface.h"
#include "support/meshes.h"
#include "support/random_links.h"
#include "support/random_numbers.h"
#include "support/sanitizers.h"
#include "support/scene.h"

namespace ist {
namespace {

/// [s] of this thread's processor time, which other processes do not lengthen.
double processor_time() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// Triangles that share no corner: every edge is open, and every triangle is a component.
LinkModel link_of_loose_triangles(std::size_t count) {
  test::Rng rng(154);
  TriangleMesh mesh;
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Vector3d at = test::random_vector(&rng, 0.5);
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    for (int k = 0; k < 3; ++k) mesh.vertices.push_back(at + test::random_vector(&rng, 0.01));
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  LinkModel link;
  link.solid = Solid(test::one(mesh));
  return link;
}

// Open edges, caps, boxes and components of 200,000 triangles took 0.3 s without a question, a
// third of the time that it takes to make the link.
TEST(PairBuilding, ASurfaceAsksOftenWhetherToGoOn) {
  const double start = processor_time();
  const LinkModel link = link_of_loose_triangles(test::kSanitized ? 10000 : 200000);
  const double making = processor_time() - start;
  constexpr double kTotal = 2.5;  // [s] then it is cancelled
  double longest = 0.0;
  const double begin = processor_time();
  double last = begin;
  const auto cancelled = [&] {
    const double now = processor_time();
    longest = std::max(longest, now - last);
    last = now;
    return now - begin > kTotal;
  };
  try {
    const LinkSurface surface(link, cancelled);
    longest = std::max(longest, processor_time() - last);
  } catch (const Cancelled&) {
  }
  const double limit = test::kSanitized ? 1.0 : 0.25 * making;
  EXPECT_LT(longest, limit) << "[s] between two questions";
  EXPECT_LT(processor_time() - begin, kTotal + limit);
}

TEST(PairBuilding, ACancelledQueryKnowsNothing) {
  const auto model =
      test::model_of({test::one(Box{{0.1, 0.1, 0.1}}), test::one(Sphere{0.1})}, 0.02);
  SelfQuery query(model, {{0, 1}}, {}, [] { return true; });
  std::vector<PairProximity> results;
  EXPECT_TRUE(query.run(std::vector<Eigen::Isometry3d>(2, Eigen::Isometry3d::Identity()),
                        {true, true}, &results));
  ASSERT_EQ(results.size(), 1U);
  EXPECT_EQ(results[0].state, LinkState::kUnknown);
  EXPECT_FALSE(results[0].decided);
}

}  // namespace
}  // namespace ist
