// Links that move among obstacles that stay: no bound is above the truth, whatever was kept from
// the pose before.

#include "support/moved_links.h"

#include <gtest/gtest.h>

#include "support/sanitizers.h"

namespace ist {
namespace {

TEST(MovedLinks, NoKeptBoundIsAboveTheTruth) {
  const test::MovedLinksReport report = test::search_moved_links(1, test::scaled(1500));
  EXPECT_GT(report.answers, 10);
  EXPECT_EQ(report.wrong_bounds, 0)
      << "by " << report.bound_excess << " m, scene " << report.worst_seed;
  EXPECT_LE(report.distance_excess, 0.0);
  EXPECT_LE(report.width_excess, 0.0);
}

}  // namespace
}  // namespace ist
