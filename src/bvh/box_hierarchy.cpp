#include "internal/bvh/box_hierarchy.h"

#include <algorithm>

namespace ist {
namespace {

constexpr auto kWidth = static_cast<std::size_t>(kBoxWidth);

void clear(BoxNode* node) {
  clear_boxes(node);
  std::fill_n(node->child, kBoxWidth, 0);
}

}  // namespace

const std::vector<std::uint32_t>& BoxHierarchy::arrange(
    const std::vector<HierarchyChild>& children) {
  items_.clear();
  for (const HierarchyChild& child : children) {
    items_.push_back(
        {(child.box.min + child.box.max).head<3>(), static_cast<std::uint32_t>(items_.size())});
  }
  arrange_range(0, items_.size());
  order_.clear();
  for (const Item& item : items_) order_.push_back(item.number);
  return order_;
}

void BoxHierarchy::arrange_range(std::size_t first, std::size_t last) {
  while (last - first > kWidth) {
    const std::size_t count = last - first;
    std::size_t unit = kWidth;
    while (unit * kWidth < count) unit *= kWidth;
    const std::size_t half = std::max<std::size_t>((count / 2 + unit / 2) / unit, 1) * unit;

    Eigen::Array3f min = items_[first].center, max = min;
    for (std::size_t i = first + 1; i < last; ++i) {
      min = min.min(items_[i].center.array());
      max = max.max(items_[i].center.array());
    }
    Eigen::Index axis;
    (max - min).maxCoeff(&axis);
    const auto at = [this](std::size_t i) {
      return items_.begin() + static_cast<std::ptrdiff_t>(i);
    };
    std::nth_element(at(first), at(first + half), at(last), [axis](const Item& a, const Item& b) {
      return a.center[axis] < b.center[axis];
    });
    arrange_range(first, first + half);
    first += half;
  }
}

void BoxHierarchy::append_nodes(const std::vector<HierarchyChild>& children,
                                std::vector<BoxNode>* nodes) {
  const std::vector<std::uint32_t>& order = arrange(children);
  for (std::size_t i = 0; i < order.size(); ++i) {
    if (i % kWidth == 0) {
      nodes->emplace_back();
      clear(&nodes->back());
    }
    BoxNode& node = nodes->back();
    const HierarchyChild& child = children[order[i]];
    node.child[append_box(child.box, &node)] = child.child;
  }
}

void BoxHierarchy::append_levels(std::vector<BoxNode>* nodes) {
  for (std::size_t begin = 0; nodes->size() - begin > 1;) {
    level_.clear();
    for (std::size_t i = begin; i < nodes->size(); ++i) {
      level_.push_back({bounds_of((*nodes)[i]), static_cast<std::int32_t>(i)});
    }
    begin = nodes->size();
    append_nodes(level_, nodes);
  }
}

}  // namespace ist
