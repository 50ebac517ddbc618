// Links that move, at random and as badly as a search has found, against brute force.

#include <gtest/gtest.h>

#include <fstream>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "support/adversarial_case.h"
#include "support/moved_links.h"
#include "support/sanitizers.h"

namespace ist {
namespace {

// Links that move among obstacles that stay: no bound is above the truth, whatever was kept from
// the pose before.
TEST(MovedLinks, NoKeptBoundIsAboveTheTruth) {
  const test::MovedLinksReport report = test::search_moved_links(1, test::scaled(1500));
  EXPECT_GT(report.answers, 10);
  EXPECT_EQ(report.wrong_bounds, 0)
      << "by " << report.bound_excess << " m, scene " << report.worst_seed;
  EXPECT_LE(report.distance_excess, 0.0);
  EXPECT_LE(report.width_excess, 0.0);
}

// The worst cases that the adversarial search (benchmark/adversarial_search.cpp) has found:
// whatever a promise says holds for them, too.
//
// Lines of a promise and a genome; lines that begin with # say what was found.
std::vector<std::pair<std::string, std::string>> kept_cases() {
  std::ifstream file(std::string(IST_PROXIMITY_SOURCE_DIR) + "/test/support/adversarial_cases.txt");
  std::vector<std::pair<std::string, std::string>> cases;
  for (std::string line; std::getline(file, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream words(line);
    cases.emplace_back();
    words >> cases.back().first >> cases.back().second;
  }
  return cases;
}

TEST(AdversarialCases, KeepEveryPromise) {
  const auto cases = kept_cases();
  ASSERT_FALSE(cases.empty());
  for (const auto& [promise, text] : cases) {
    SCOPED_TRACE(promise + " " + text);
    const test::Genome genome = test::genome_from(text);
    ASSERT_EQ(genome.size(), test::kGenomeSize);
    const test::Violations found = test::judge(test::AdversarialCase(genome, nullptr));
    for (std::size_t i = 0; i < test::Violations::kCount; ++i) {
      EXPECT_LE(found.excess[i], 0.0) << test::Violations::kNames[i];
    }
  }
}

}  // namespace
}  // namespace ist
