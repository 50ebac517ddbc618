#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "ist_proximity/packing/packing.h"
#include "ist_proximity/tree/tree_config.h"

namespace ist {

/// Balls that belong together: from first to before second, in an order of indices.
using BallRange = std::pair<std::uint32_t, std::uint32_t>;

/// The balls of a tree, and the order that its ranges are of.
struct BallOrder {
  const std::vector<Ball>* balls;
  std::vector<std::uint32_t> indices;

  const Ball& operator[](std::uint32_t i) const { return (*balls)[indices[i]]; }
};

inline std::uint32_t size(const BallRange& range) { return range.second - range.first; }

/// Divides a range of more than kSphereWidth balls into 2 to kSphereWidth groups, a node's
/// children, one after another and none empty; reorders the range. Groups of up to kSphereWidth
/// balls become leaves. Deterministic.
/// @param levels_left  the groups' own trees may be this deep, leaves included
std::vector<BallRange> partition(const TreeConfig& config, const BallRange& range, int levels_left,
                                 BallOrder* order);

/// The levels of a tree over `count` balls that is halved at medians.
int median_levels(std::uint32_t count);

/// The three ways. The last one gives a single group where no prototypes divide the balls.
std::vector<BallRange> split_at_medians(const BallRange& range, std::size_t most, BallOrder* order);
std::vector<BallRange> split_by_surface(const BallRange& range, BallOrder* order);
std::vector<BallRange> split_by_neural_gas(const BallRange& range, double magnification,
                                           BallOrder* order);

}  // namespace ist
