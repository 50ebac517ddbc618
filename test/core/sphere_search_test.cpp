#include "packing/sphere_search.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "support/scene.h"

namespace ist {
namespace {

struct Weighted {
  Eigen::Vector3d center;
  double weight;
};

double cost_of(const Weighted& sphere, const Eigen::Vector3d* corners, int count) {
  double farthest = 0.0;
  for (int k = 0; k < count; ++k)
    farthest = std::max(farthest, (corners[k] - sphere.center).norm());
  return farthest - sphere.weight;
}

// Large spheres among small ones; some occur twice, some have weight 0 or a negative one.
Weighted any_sphere(test::Rng* rng, const std::vector<Weighted>& before) {
  if (!before.empty() && test::uniform(rng, 0, 1) < 0.1) return before[before.size() / 2];
  const double size = test::uniform(rng, 0, 1);
  return {test::random_vector(rng, 1.0), size * size * size - 0.1};
}

// Spheres in a row, each added next to the one before: the BVH grows on one side only.
Weighted next_on_a_line(test::Rng* /*rng*/, const std::vector<Weighted>& before) {
  return {{1e-3 * static_cast<double>(before.size()), 0, 0}, 0.1};
}

Weighted the_same(test::Rng* /*rng*/, const std::vector<Weighted>& /*before*/) {
  return {{0.1, 0.2, 0.3}, 0.1};
}

TEST(SphereSearch, FindsTheBestWhileSpheresAreAdded) {
  for (const auto& next : {any_sphere, next_on_a_line, the_same}) {
    test::Rng rng(1);
    std::vector<Weighted> spheres;
    SphereSearch search;
    for (std::size_t n = 1; n <= 1500; ++n) {
      spheres.push_back(next(&rng, spheres));
      search.add(spheres.back().center, spheres.back().weight);
      ASSERT_EQ(search.size(), n);
      const int count = static_cast<int>(1 + n % 8);
      const double patch = test::uniform(&rng, 0, 0.1);
      std::vector<Eigen::Vector3d> corners(8, test::random_vector(&rng, 1.2));
      for (Eigen::Vector3d& corner : corners) corner += test::random_vector(&rng, patch);
      std::size_t best = 0;
      for (std::size_t i = 1; i < n; ++i) {
        if (cost_of(spheres[i], corners.data(), count) <
            cost_of(spheres[best], corners.data(), count))
          best = i;
      }
      const auto hint = static_cast<std::uint32_t>(n * 7 % n);
      const SphereSearch::Match match = search.best(corners.data(), count, hint);
      ASSERT_EQ(match.sphere, best) << "the first of equal spheres";
      ASSERT_NEAR(match.cost, cost_of(spheres[best], corners.data(), count), 1e-12);
      // Spheres before `first` may be ignored, but not the others.
      const std::size_t first = n / 2;
      const double of_new = search.best(corners.data(), count, hint, first).cost;
      for (std::size_t i = first; i < n; ++i) {
        ASSERT_LE(of_new, cost_of(spheres[i], corners.data(), count) + 1e-12);
      }
      ASSERT_LE(of_new, cost_of(spheres[hint], corners.data(), count) + 1e-12);
      // The search may end at any sphere that is good enough.
      const double enough = match.cost + test::uniform(&rng, -0.1, 0.2);
      const SphereSearch::Match any = search.best(corners.data(), count, hint, 0, enough);
      ASSERT_NEAR(any.cost, cost_of(spheres[any.sphere], corners.data(), count), 1e-12);
      ASSERT_LE(any.cost, std::max(enough, match.cost));
    }
  }
}

}  // namespace
}  // namespace ist
