#include "cloud/filters/self_filter.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "internal/geometry/relative_pose.h"
#include "internal/geometry/solid_queries.h"

namespace ist {
namespace {

// Covers the rounding of float coordinates and radii, as a share of the numbers involved.
constexpr double kRounding = 1e-6;

std::uint32_t all_of(const PointTile& tile) {
  return (1U << static_cast<std::uint32_t>(tile.count)) - 1U;
}

}  // namespace

void SelfFilter::pose(const PosedRobot& robot, const Eigen::Isometry3d& X_FO, double padding) {
  padding_ = padding;
  links_.clear();
  add(robot, X_FO);
}

void SelfFilter::add(const PosedRobot& robot, const Eigen::Isometry3d& X_FO) {
  if (robot.model == nullptr) return;
  const std::size_t count =
      std::min({robot.model->links.size(), robot.known.size(), robot.X_FL.size()});
  for (std::size_t i = 0; i < count; ++i) {
    const LinkModel& model = robot.model->links[i];
    if (!robot.known[i] || !model.usable() || model.tree.empty()) continue;
    const InnerSphereTree& tree = model.tree;
    const Eigen::Isometry3d X_OL = relative_pose(X_FO, robot.X_FL[i]);
    const double clear_beyond = std::max(padding_, tree.interior_gap());
    const double size = tree.center().norm() + tree.radius() + clear_beyond;
    PosedLink link;
    link.model = &model;
    link.X_LO = X_OL.inverse();
    link.center_O = (X_OL * tree.center()).cast<float>();
    link.slack = static_cast<float>(kRounding * (size + X_OL.translation().norm()));
    link.clear_beyond = static_cast<float>(clear_beyond) + link.slack;
    link.reach = static_cast<float>(tree.radius()) + link.clear_beyond;
    links_.push_back(link);
  }
}

// Whether a sphere may touch what the link claims.
bool SelfFilter::is_near(const PosedLink& link, const Eigen::Vector3f& center_O, float radius) {
  const float reach = link.reach + radius * (1.0F + static_cast<float>(kRounding));
  return !((center_O - link.center_O).squaredNorm() > reach * reach);
}

bool SelfFilter::may_drop(const PaddedBox& box) const {
  const Eigen::Vector3f center = 0.5F * (box.min + box.max).head<3>();
  const float radius = 0.5F * box.diagonal();
  return std::any_of(links_.begin(), links_.end(), [&center, radius](const PosedLink& link) {
    return is_near(link, center, radius);
  });
}

std::uint32_t SelfFilter::on_robot(const PointTile& tile, const PaddedBox& box) const {
  const Eigen::Vector3f center = 0.5F * (box.min + box.max).head<3>();
  const float radius = 0.5F * box.diagonal();
  std::uint32_t mask = 0;
  for (const PosedLink& link : links_) {
    if (!is_near(link, center, radius)) continue;
    mask |= on_link(link, tile, center.cast<double>(), static_cast<double>(radius));
    if (mask == all_of(tile)) break;
  }
  return mask;
}

std::uint32_t SelfFilter::on_link(const PosedLink& link, const PointTile& tile,
                                  const Eigen::Vector3d& center_O, double radius) const {
  switch (ask_tree(link, link.X_LO * center_O, radius)) {
    case Verdict::kClear:
      return 0;
    case Verdict::kOnLink:
      return all_of(tile);
    case Verdict::kOpen:
      break;
  }
  std::uint32_t mask = 0;
  for (std::int32_t k = 0; k < tile.count; ++k) {
    const Eigen::Vector3f p_O(tile.x[k], tile.y[k], tile.z[k]);
    const Eigen::Vector3d p_L = link.X_LO * p_O.cast<double>();
    const Verdict verdict = ask_tree(link, p_L, 0.0);
    const bool on_robot =
        verdict == Verdict::kOnLink || (verdict == Verdict::kOpen && ask_geometry(link, p_L));
    mask |= static_cast<std::uint32_t>(on_robot) << k;
  }
  return mask;
}

// Asks for all points within `radius` of a centre at once. Walks down where an cover sphere may be
// near enough, deepest child first; the first inner sphere that holds all of them ends it.
SelfFilter::Verdict SelfFilter::ask_tree(const PosedLink& link, const Eigen::Vector3d& center_L,
                                         double radius) const {
  const InnerSphereTree& tree = link.model->tree;
  const Eigen::Vector3f c = center_L.cast<float>();
  const float near = link.clear_beyond + static_cast<float>(radius) * (1.0F + 1e-6F);
  const float held = static_cast<float>(padding_ - radius) - link.slack;

  // How far inside reach [m^2] the centre is from each of eight spheres; negative: not.
  std::array<float, kSphereWidth> inside;
  const auto within = [&c, &inside](const float* x, const float* y, const float* z, const float* r,
                                    float margin) {
    bool any = false;
    for (std::size_t k = 0; k < static_cast<std::size_t>(kSphereWidth); ++k) {
      const float dx = x[k] - c.x(), dy = y[k] - c.y(), dz = z[k] - c.z();
      const float reach = std::max(r[k] + margin, 0.0F);
      inside[k] = reach * reach - (dx * dx + dy * dy + dz * dz);
      any |= inside[k] > 0.0F;
    }
    return any;
  };

  struct Entry {
    std::int32_t child;
    float inside;
  };
  std::array<Entry, 512> stack;  // eight children on each of the levels that 2^31 spheres can have
  std::size_t top = 0;
  stack[top++] = {0, 0.0F};
  bool open = false;
  while (top > 0) {
    const std::int32_t child = stack[--top].child;
    if (child < 0) {
      const SphereLeaf& leaf = tree.leaves()[static_cast<std::size_t>(~child)];
      if (within(leaf.x, leaf.y, leaf.z, leaf.inner_radius, held)) return Verdict::kOnLink;
      open = open || within(leaf.x, leaf.y, leaf.z, leaf.cover_radius, near);
      continue;
    }
    const SphereNode& node = tree.nodes()[static_cast<std::size_t>(child)];
    within(node.x, node.y, node.z, node.radius, near);
    const std::size_t begin = top;
    for (std::size_t k = 0; k < static_cast<std::size_t>(node.count); ++k) {
      if (inside[k] <= 0.0F) continue;
      std::size_t at = top++;
      for (; at > begin && stack[at - 1].inside > inside[k]; --at) stack[at] = stack[at - 1];
      stack[at] = {node.child[k], inside[k]};
    }
  }
  return open ? Verdict::kOpen : Verdict::kClear;
}

bool SelfFilter::ask_geometry(const PosedLink& link, const Eigen::Vector3d& p_L) const {
  const LinkModel& model = *link.model;
  const double just_beyond = padding_ + kRounding;
  if (distance_outside(model.solid, p_L, just_beyond).distance <= padding_) return true;
  // Beyond the padding from the surface: outside, where the tree can tell, or deep inside.
  const double gap = model.tree.interior_gap();
  return model.tree.cover_distance(p_L, gap) <= gap && model.solid.is_inside(p_L);
}

}  // namespace ist
