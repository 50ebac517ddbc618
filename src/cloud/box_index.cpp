#include "ist_proximity/cloud/box_index.h"

#include <algorithm>

#include "cloud/box_hierarchy.h"

namespace ist {
namespace {

PaddedBox relative(const Eigen::AlignedBox3d& box, const Eigen::Vector3d& origin) {
  PaddedBox result{Eigen::Array4f::Zero(), Eigen::Array4f::Zero()};
  result.min.head<3>() = (box.min() - origin).cast<float>();
  result.max.head<3>() = (box.max() - origin).cast<float>();
  return result;
}

void clear(BoxTile* tile) {
  for (int k = 0; k < kPointWidth; ++k) {
    tile->min_x[k] = tile->min_y[k] = tile->min_z[k] = kFarAway;
    tile->max_x[k] = tile->max_y[k] = tile->max_z[k] = kFarAway;
    tile->id[k] = 0;
  }
  tile->count = 0;
}

void append(const PaddedBox& box, std::uint32_t id, BoxTile* tile) {
  const int k = tile->count++;
  tile->min_x[k] = box.min[0];
  tile->min_y[k] = box.min[1];
  tile->min_z[k] = box.min[2];
  tile->max_x[k] = box.max[0];
  tile->max_y[k] = box.max[1];
  tile->max_z[k] = box.max[2];
  tile->id[k] = id;
}

}  // namespace

void BoxIndex::build(const std::vector<Eigen::AlignedBox3d>& boxes) {
  generation_ = next_generation();
  size_ = boxes.size();
  origin_.setZero();
  if (!boxes.empty()) {
    Eigen::AlignedBox3d all;
    for (const Eigen::AlignedBox3d& box : boxes) all.extend(box);
    origin_ = all.center().array().round();
  }
  std::vector<PaddedBox> leaves;
  std::vector<HierarchyItem> items;
  leaves.reserve(boxes.size());
  items.reserve(boxes.size());
  for (const Eigen::AlignedBox3d& box : boxes) {
    leaves.push_back(relative(box, origin_));
    items.push_back({(leaves.back().min + leaves.back().max).head<3>(),
                     static_cast<std::int32_t>(items.size())});
  }
  arrange(&items);

  const auto width = static_cast<std::size_t>(kPointWidth);
  tiles_.resize((items.size() + width - 1) / width);
  std::vector<PaddedBox> tile_boxes;
  std::vector<HierarchyItem> tile_items;
  for (std::size_t t = 0; t < tiles_.size(); ++t) {
    clear(&tiles_[t]);
    const std::size_t first = t * width, last = std::min(first + width, items.size());
    PaddedBox around = leaves[static_cast<std::size_t>(items[first].leaf)];
    for (std::size_t i = first; i < last; ++i) {
      const PaddedBox& box = leaves[static_cast<std::size_t>(items[i].leaf)];
      append(box, static_cast<std::uint32_t>(items[i].leaf), &tiles_[t]);
      around.extend(box);
    }
    tile_boxes.push_back(around);
    tile_items.push_back({Eigen::Vector3f::Zero(), static_cast<std::int32_t>(t)});
  }
  // Already in order: sixteen consecutive tiles belong together.
  write_nodes(tile_items, tile_boxes, &nodes_);
}

}  // namespace ist
