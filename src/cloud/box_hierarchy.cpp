#include "cloud/box_hierarchy.h"

#include <algorithm>
#include <atomic>

namespace ist {
namespace {

constexpr auto kWidth = static_cast<std::uint32_t>(kPointWidth);

std::size_t nodes_over(std::size_t children) { return (children + kWidth - 1) / kWidth; }

void clear(BoxNode* node) {
  for (int k = 0; k < kPointWidth; ++k) {
    node->min_x[k] = node->min_y[k] = node->min_z[k] = kFarAway;
    node->max_x[k] = node->max_y[k] = node->max_z[k] = kFarAway;
    node->child[k] = 0;
  }
  node->count = 0;
}

void append(std::int32_t child, const PaddedBox& box, BoxNode* node) {
  const int k = node->count++;
  node->min_x[k] = box.min[0];
  node->min_y[k] = box.min[1];
  node->min_z[k] = box.min[2];
  node->max_x[k] = box.max[0];
  node->max_y[k] = box.max[1];
  node->max_z[k] = box.max[2];
  node->child[k] = child;
}

PaddedBox child_box(const BoxNode& node, int k) {
  return {{node.min_x[k], node.min_y[k], node.min_z[k], 0.0F},
          {node.max_x[k], node.max_y[k], node.max_z[k], 0.0F}};
}

void arrange_range(std::vector<HierarchyItem>* items, std::size_t first, std::size_t last) {
  while (last - first > kWidth) {
    const std::size_t count = last - first;
    std::size_t unit = kWidth;
    while (unit * kWidth < count) unit *= kWidth;
    const std::size_t half = std::max<std::size_t>((count / 2 + unit / 2) / unit, 1) * unit;

    Eigen::Array3f min = (*items)[first].center, max = min;
    for (std::size_t i = first + 1; i < last; ++i) {
      min = min.min((*items)[i].center.array());
      max = max.max((*items)[i].center.array());
    }
    Eigen::Index axis;
    (max - min).maxCoeff(&axis);
    const auto at = [items](std::size_t i) {
      return items->begin() + static_cast<std::ptrdiff_t>(i);
    };
    std::nth_element(at(first), at(first + half), at(last),
                     [axis](const HierarchyItem& a, const HierarchyItem& b) {
                       return a.center[axis] < b.center[axis];
                     });
    arrange_range(items, first, first + half);
    first += half;
  }
}

}  // namespace

void arrange(std::vector<HierarchyItem>* items) { arrange_range(items, 0, items->size()); }

PaddedBox box_of(const BoxNode& node) {
  PaddedBox box = child_box(node, 0);
  for (int k = 1; k < node.count; ++k) box.extend(child_box(node, k));
  return box;
}

void write_nodes(const std::vector<HierarchyItem>& items, const std::vector<PaddedBox>& boxes,
                 std::vector<BoxNode>* nodes) {
  nodes->resize(nodes_over(items.size()));
  if (nodes->empty()) return;
  for (BoxNode& node : *nodes) clear(&node);
  for (std::size_t i = 0; i < items.size(); ++i) {
    const std::int32_t leaf = items[i].leaf;
    append(~leaf, boxes[static_cast<std::size_t>(leaf)], &(*nodes)[i / kWidth]);
  }
  std::size_t begin = 0, end = nodes->size();
  while (end - begin > 1) {
    nodes->resize(end + nodes_over(end - begin));
    for (std::size_t i = end; i < nodes->size(); ++i) clear(&(*nodes)[i]);
    for (std::size_t i = begin; i < end; ++i) {
      append(static_cast<std::int32_t>(i), box_of((*nodes)[i]),
             &(*nodes)[end + (i - begin) / kWidth]);
    }
    begin = end;
    end = nodes->size();
  }
}

std::uint64_t next_generation() {
  static std::atomic<std::uint64_t> builds{0};
  return ++builds;
}

}  // namespace ist
