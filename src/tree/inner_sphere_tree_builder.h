#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "ist_proximity/packing/packing.h"
#include "ist_proximity/tree/inner_sphere_tree.h"
#include "tree/partition.h"

namespace ist {

/// Builds the nodes and leaves of an Inner Sphere Tree, from the root down.
class InnerSphereTreeBuilder {
 public:
  struct BoundingSphere {
    Eigen::Vector3f center;  ///< [m]
    double radius;           ///< [m]
  };

  InnerSphereTreeBuilder(const std::vector<InnerSphere>& spheres, std::vector<SphereNode>* nodes,
                         std::vector<SphereLeaf>* leaves);
  InnerSphereTreeBuilder(const InnerSphereTreeBuilder&) = delete;
  InnerSphereTreeBuilder& operator=(const InnerSphereTreeBuilder&) = delete;

  /// Appends all nodes and leaves. The root is a node even if a leaf could hold all spheres, so
  /// that a query starts in the same way for every link.
  void run() { add_node(all()); }

  /// A sphere that encloses the cover spheres of a range.
  BoundingSphere bounding_sphere(const SphereRange& range) const;
  SphereRange all() const { return {0, static_cast<std::uint32_t>(order_.indices.size())}; }

 private:
  std::int32_t add_node(const SphereRange& range);
  std::int32_t add_leaf(const SphereRange& range);

  std::vector<SphereNode>& nodes_;
  std::vector<SphereLeaf>& leaves_;
  std::vector<InnerSphere> spheres_;  // rounded: the nodes enclose exactly what the leaves hold
  SphereOrder order_;
};

}  // namespace ist
