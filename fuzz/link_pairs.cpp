// Two links of one robot, poses one after the other, with deadlines, against brute force in double.
// Covers: src/proximity/self_query.cpp src/proximity/link_pair_query.cpp
// Covers: src/proximity/link_pair_search.cpp src/proximity/surface_pair_search.cpp
// Covers: src/proximity/opening_search.cpp src/proximity/link_surface.cpp
// Covers: src/geometry/surface_bvh.cpp src/geometry/triangle_distance.cpp src/geometry/openings.cpp
// Longest input: 200

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "ist_proximity/proximity/self_query.h"
#include "support/broken_promise.h"
#include "support/byte_reader.h"
#include "support/check.h"
#include "support/link_bank.h"
#include "support/query_config_from_bytes.h"

namespace {

using ist::fuzz::ByteReader;

const std::vector<ist::test::PairBody>& bodies() {
  static const std::vector<ist::test::PairBody> kBodies(ist::fuzz::link_bank().geometries.begin(),
                                                        ist::fuzz::link_bank().geometries.end());
  return kBodies;
}

/// A query of one pair.
ist::SelfQuery query_of(const ist::LinkPair& pair, bool is_coarse) {
  const ist::fuzz::LinkBank& bank = ist::fuzz::link_bank();
  return {is_coarse ? bank.coarse : bank.fine, {pair}, {}};
}

/// Whether every place is inside or outside of a link for certain.
bool is_closed(std::size_t link) {
  return ist::fuzz::link_bank().coarse->links[link].solid.is_closed();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  ByteReader in(data, size);
  const std::size_t first = in.below(bodies().size());
  const std::size_t second = (first + 1 + in.below(bodies().size() - 1)) % bodies().size();
  ist::SelfQuery query = query_of({first, second}, in.flag());
  std::vector<Eigen::Isometry3d> X_FL(bodies().size(), Eigen::Isometry3d::Identity());
  std::vector<bool> known(bodies().size(), false);
  known[first] = known[second] = true;
  X_FL[first] = in.pose(1.0);
  X_FL[second] = X_FL[first] * in.pose(0.3);
  ist::QueryConfig config = ist::fuzz::query_config_from(&in);
  std::vector<ist::PairProximity> answers;
  for (std::size_t step = 1 + in.below(6); step > 0; --step) {
    const std::uint8_t changes = in.byte();
    Eigen::Isometry3d& X = X_FL[(changes & 1U) != 0 ? first : second];
    if ((changes & 6U) != 0) X = X * in.pose(std::pow(10.0, in.between(-7.0, -0.7)));
    if ((changes & 24U) == 24U) config = ist::fuzz::query_config_from(&in);
    query.set_config(config);
    const bool is_complete = query.run(X_FL, known, &answers);
    FUZZ_CHECK(is_complete || config.deadline == ist::fuzz::kPassed,
               "there was time, and not complete");
    const ist::test::PairTruth truth = ist::test::pair_truth(bodies()[first], bodies()[second],
                                                             X_FL[first].inverse() * X_FL[second],
                                                             is_closed(first) && is_closed(second));
    const std::string broken = ist::test::broken_promise(answers[0], truth, config, is_complete);
    FUZZ_CHECK(broken.empty(), "%s", broken.c_str());
  }
  return 0;
}
