#pragma once

namespace ist {

/// How the spheres of a node are divided among its children.
enum class TreeSplit {
  /// Halved at the median along the longest axis, the fullest part first, until there are enough.
  kMedian,
  /// Halved where the boxes of the two parts have the least surface, weighted by how many leaves
  /// are in them (surface-area heuristic, Goldsmith and Salmon 1987).
  kSurfaceArea,
  /// Batch neural gas: prototypes settle among the spheres, and each sphere goes to the nearest one
  /// (Weller 2013, section 5.2.1; Hammer, Hasenfuss and Villmann 2007).
  kNeuralGas,
};

/// How an Inner Sphere Tree is built. It changes what a query costs, never what it answers.
struct TreeConfig {
  TreeSplit split = TreeSplit::kNeuralGas;
  /// Of neural gas, 0 to 1: each sphere counts by this power of its volume. 1 draws prototypes to
  /// large spheres, as the book does; 0 lets every sphere count alike, which serves distances
  /// better (doc/packing.md).
  double magnification = 0.0;
};

}  // namespace ist
