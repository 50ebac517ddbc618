// The depth of one link in another: the lower bound holds however early the search ends.

#include "proximity/link_pair_search.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <vector>

#include "support/meshes.h"
#include "support/sanitizers.h"
#include "support/scene.h"

namespace ist {
namespace {

double lower_bound(const RobotModel& model, const Eigen::Isometry3d& X_BA, int steps) {
  std::vector<LinkPairSearch::Entry> queue;
  QueryConfig config;
  config.tolerance = 0.0;
  LinkPairSearch search(model.links[0], model.links[1], X_BA, config, &queue);
  search.run(steps);
  EXPECT_LE(search.lower_bound(), search.distance());
  return search.lower_bound();
}

// Parts of the tree that were not visited before the steps were used up count with their bounds.
TEST(LinkPairSearch, StoppedBoundsHold) {
  test::Rng rng(301);
  const Box slab{{0.4, 0.3, 0.1}};
  const auto model = test::make_model({test::l_shape(0.4, 0.05), slab}, 0.002);
  ASSERT_GT(model->links[0].tree.leaves().size(), test::kSanitized ? 25U : 50U);
  const TriangleMesh mesh = test::l_shape(0.4, 0.05);
  int stopped = 0;
  for (int i = 0; i < test::scaled(200); ++i) {
    const Eigen::Isometry3d X_BA = test::random_pose(&rng, 0.2);
    double deepest = std::numeric_limits<double>::infinity();  // of A's corners and edges
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      for (int k = 0; k < 3; ++k) {
        for (double share = 0.0; share < 1.0; share += 0.02) {
          const Eigen::Vector3d p_A =
              (1.0 - share) * mesh.corner(t, k) + share * mesh.corner(t, (k + 1) % 3);
          const Eigen::Vector3d q = (X_BA * p_A).cwiseAbs() - 0.5 * slab.size;
          deepest = std::min(deepest, q.cwiseMax(0.0).norm() + std::min(q.maxCoeff(), 0.0));
        }
      }
    }
    const double whole = lower_bound(*model, X_BA, 1000000);
    EXPECT_LE(whole, deepest + 1e-9);
    for (const int steps : {0, 1, 2, 3, 5, 10, 30, 100}) {
      const double bound = lower_bound(*model, X_BA, steps);
      EXPECT_LE(bound, deepest + 1e-9) << "case " << i << ", " << steps << " steps";
      stopped += bound < whole - 1e-6 ? 1 : 0;
    }
  }
  EXPECT_GT(stopped, test::scaled(100)) << "the searches must be longer than their steps";
}

}  // namespace
}  // namespace ist
