#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "internal/geometry/triangle_bvh.h"

namespace ist {

/// Builds an 8-wide hierarchy from the root down, by three levels of median splits per node.
class TriangleBvhBuilder {
 public:
  TriangleBvhBuilder(const TriangleMesh& mesh, const CancelRequest& cancelled, TriangleBvh* bvh)
      : mesh_(mesh), cancelled_(cancelled), bvh_(*bvh) {}
  /// @throws Cancelled
  void run();

 private:
  using Range = std::pair<std::uint32_t, std::uint32_t>;

  void store_triangles();
  std::int32_t add_node(const Range& range);
  std::int32_t add_leaf(const Range& range);
  std::uint32_t split(const Range& range);
  void set_box(const Range& range, TriangleBvh::Boxes* boxes, std::size_t slot) const;
  void set_slab(const Range& range, TriangleBvh::Slabs* slabs, std::size_t slot) const;
  void set_moments(const Range& range, TriangleBvh::Moments* moments, std::size_t slot) const;

  const TriangleMesh& mesh_;
  const CancelRequest& cancelled_;
  TriangleBvh& bvh_;
  std::vector<TriangleBvh::Triangle> triangles_;  ///< in the order of the leaves, once all are made
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();
};

}  // namespace ist
