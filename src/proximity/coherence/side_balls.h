#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "internal/geometry/solid_queries.h"

namespace ist {

/// Balls about places whose side of a link's surface was decided: all places in a ball are on the
/// same side. They belong to the link alone, so they hold at every pose and for every cloud, and a
/// place in one of them needs no winding number.
///
/// Balls are found by the cell of a grid that their centre is in, in a table of sets: a new ball
/// takes the place of the smallest one of its set. What a set holds for another cell is true as
/// well, and of no use. Memory is allocated once. One thread.
class SideBalls {
 public:
  using Side = NearSurface::Side;

  struct Found {
    Side side = Side::kUnknown;
    double margin = 0.0;  ///< [m] every place nearer than this is on that side
  };

  /// @param has_holes  whether the link is a mesh with holes: these need many balls
  explicit SideBalls(bool has_holes) : sets_(has_holes ? kSetsWithHoles : kSets) {}

  Found find(const Eigen::Vector3d& p_LQ) const;
  /// @param found  of p_LQ; with a margin that is not positive, nothing is stored
  void store(const Eigen::Vector3d& p_LQ, const Found& found);

  std::size_t memory() const { return sets_.capacity() * sizeof(Set); }  ///< [bytes]

 private:
  struct Ball {
    float x = 0.0F, y = 0.0F, z = 0.0F;  ///< [m]
    float radius = 0.0F;                 ///< [m] negative: of places inside; 0: no ball
  };
  static constexpr std::size_t kWays = 2, kSetsWithHoles = 1024, kSets = 32;  // powers of two
  struct Set {
    Ball balls[kWays];
  };

  std::size_t set_of(const std::int64_t cell[3]) const;

  std::vector<Set> sets_;
};

}  // namespace ist
