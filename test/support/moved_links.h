#pragma once

#include <cstdint>

/// Answers of links that move while their cloud stays: what a search keeps from one pose to the
/// next must hold at the next one. The scenes are made to be hard for kept bounds: a shell of
/// points about the link and a cluster as near as the shell, so that the nearest side changes with
/// a step.
namespace ist::test {

/// What is wrong with the answers, at most; 0 or less: nothing.
struct MovedLinksReport {
  std::int64_t answers = 0;       ///< that were given
  std::int64_t wrong_bounds = 0;  ///< of them, with a bound above the truth
  double bound_excess = 0.0;      ///< [m] of a lower bound above the truth
  double distance_excess =
      0.0;                    ///< [m] of a distance that is no obstacle's, or beyond the tolerance
  double width_excess = 0.0;  ///< [m] of distance - lower_bound beyond the tolerance
  std::uint64_t worst_seed = 0;  ///< of the scene with the largest `bound_excess`
};

/// Links of primitives and meshes, closed and open, with and without distance fields, at tolerance
/// 0 and 1 mm, among points and boxes of a map: some steps of 0.1 to 100 mm, then one towards the
/// cluster, then a turn anywhere. Each answer is compared with all points in double precision.
/// @param seed   of the first scene
/// @param count  scenes, of some ten answers each; scene i is that of `seed + i`
MovedLinksReport search_moved_links(std::uint64_t seed, std::int64_t count);

}  // namespace ist::test
