#include "internal/bvh/box_hierarchy.h"
#include "internal/bvh/build_id.h"
#include "internal/cloud/box_bvh.h"
#include "ist_proximity/cloud/cloud_snapshot.h"

namespace ist {
namespace {

PaddedBox relative(const Eigen::AlignedBox3d& box, const Eigen::Vector3d& origin) {
  PaddedBox result{Eigen::Array4f::Zero(), Eigen::Array4f::Zero()};
  result.min.head<3>() = (box.min() - origin).cast<float>();
  result.max.head<3>() = (box.max() - origin).cast<float>();
  return result;
}

}  // namespace

BoxBvh::BoxBvh(const std::vector<Eigen::AlignedBox3d>& boxes)
    : size_(boxes.size()), build_id_(next_build_id()) {
  if (!boxes.empty()) {
    Eigen::AlignedBox3d all;
    for (const Eigen::AlignedBox3d& box : boxes) all.extend(box);
    origin_ = all.center().array().round();
  }
  std::vector<HierarchyChild> leaves;
  leaves.reserve(boxes.size());
  for (const Eigen::AlignedBox3d& box : boxes) leaves.push_back({relative(box, origin_), 0});

  BoxHierarchy hierarchy;
  for (const std::uint32_t leaf : hierarchy.arrange(leaves)) {
    if (tiles_.empty() || tiles_.back().count == kBoxWidth) {
      tiles_.emplace_back();
      clear_boxes(&tiles_.back());
    }
    BoxTile& tile = tiles_.back();
    tile.id[append_box(leaves[leaf].box, &tile)] = leaf;
  }
  std::vector<HierarchyChild> children;
  for (std::size_t t = 0; t < tiles_.size(); ++t) {
    children.push_back({bounds_of(tiles_[t]), ~static_cast<std::int32_t>(t)});
  }
  hierarchy.append_nodes(children, &nodes_);
  hierarchy.append_levels(&nodes_);
}

BoxIndex::BoxIndex() {
  static const auto kEmpty = std::make_shared<const BoxBvh>();
  bvh_ = kEmpty;
}

void BoxIndex::build(const std::vector<Eigen::AlignedBox3d>& boxes) {
  bvh_ = std::make_shared<const BoxBvh>(boxes);
}

bool BoxIndex::empty() const { return bvh_->empty(); }
std::size_t BoxIndex::size() const { return bvh_->size(); }
const Eigen::Vector3d& BoxIndex::origin() const { return bvh_->origin(); }
std::uint64_t BoxIndex::build_id() const { return bvh_->build_id(); }

}  // namespace ist
