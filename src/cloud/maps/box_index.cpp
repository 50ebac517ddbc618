#include "ist_proximity/cloud/box_index.h"

#include "cloud/index/box_hierarchy.h"

namespace ist {
namespace {

PaddedBox relative(const Eigen::AlignedBox3d& box, const Eigen::Vector3d& origin) {
  PaddedBox result{Eigen::Array4f::Zero(), Eigen::Array4f::Zero()};
  result.min.head<3>() = (box.min() - origin).cast<float>();
  result.max.head<3>() = (box.max() - origin).cast<float>();
  return result;
}

}  // namespace

void BoxIndex::build(const std::vector<Eigen::AlignedBox3d>& boxes) {
  build_id_ = next_build_id();
  size_ = boxes.size();
  origin_.setZero();
  if (!boxes.empty()) {
    Eigen::AlignedBox3d all;
    for (const Eigen::AlignedBox3d& box : boxes) all.extend(box);
    origin_ = all.center().array().round();
  }
  std::vector<HierarchyChild> leaves;
  leaves.reserve(boxes.size());
  for (const Eigen::AlignedBox3d& box : boxes) leaves.push_back({relative(box, origin_), 0});

  BoxHierarchy hierarchy;
  tiles_.clear();
  for (const std::uint32_t leaf : hierarchy.arrange(leaves)) {
    if (tiles_.empty() || tiles_.back().count == kPointWidth) {
      tiles_.emplace_back();
      clear_boxes(&tiles_.back());
    }
    BoxTile& tile = tiles_.back();
    tile.id[append_box(leaves[leaf].box, &tile)] = leaf;
  }
  std::vector<HierarchyChild> children;
  for (std::size_t t = 0; t < tiles_.size(); ++t) {
    children.push_back({box_around(tiles_[t]), ~static_cast<std::int32_t>(t)});
  }
  nodes_.clear();
  hierarchy.append_nodes(children, &nodes_);
  hierarchy.append_levels(&nodes_);
}

}  // namespace ist
