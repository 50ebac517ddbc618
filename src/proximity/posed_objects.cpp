#include "proximity/posed_objects.h"

#include <algorithm>

#include "internal/bvh/box_hierarchy.h"
#include "internal/geometry/numbers.h"
#include "proximity/world_shape.h"

namespace ist {
namespace {

// [m] The path is counted anew after this length, so that it keeps its digits.
constexpr double kLongestPath = 1e4;
// Objects in a group, at most.
constexpr std::size_t kGroupSize = 2 * kBoxWidth;
// The rounding of a sphere about boxes, as a share of all coordinates involved.
constexpr double kRounding = 1e-14;

// [m] The sphere about an object's box, in the frame that the object stands in.
struct ObjectSphere {
  explicit ObjectSphere(const KnownWorld::Object& object)
      : drift(nearest_rigid(object.X_BO).drift),
        center_B(object.X_BO * object.shape->surface.box.center()),
        // No singular value of the linear part exceeds 1 + drift / 2.
        radius(0.5 * object.shape->surface.box.sizes().norm() * (1.0 + drift)) {}

  double drift;
  Eigen::Vector3d center_B;
  double radius;
};

}  // namespace

void PosedObject::place(const Eigen::Isometry3d& X_FO_given) {
  const Eigen::AlignedBox3d& box = object->shape->surface.box;
  X_FO = nearest_rigid(X_FO_given);
  center_F = X_FO.X * box.center();
  half = 0.5 * box.sizes();
  radius = half.norm();
  extent = box.center().norm() + radius;
}

// A point x of an object is placed at Q x + t, Q the rotation nearest to R_FB R_BO. It is no
// farther from R_FB R_BO x + t than the drift of that product times |x|; the drift of a product is
// no more than the sum of the drifts, but for their squares.
void ObjectGroup::place(const Eigen::Isometry3d& X_FB) {
  constexpr double kMaxDrift = 0.01, kSquares = 1.1;
  const double frame_drift = nearest_rigid(X_FB).drift;
  drift = kSquares * (frame_drift + drift_B);
  center_F = X_FB * center_B;
  radius = radius_B * (1.0 + frame_drift) + drift * extent;
  if (!(frame_drift <= kMaxDrift && drift_B <= kMaxDrift)) radius = kInfinity;
}

double ObjectGroup::moves_at_most(const Eigen::Isometry3d& X_FB,
                                  const Eigen::Isometry3d& X_FB_next) const {
  ObjectGroup next = *this;
  next.place(X_FB_next);
  if (!(radius < kInfinity && next.radius < kInfinity)) return kInfinity;
  const double turned = (X_FB_next.linear() - X_FB.linear()).norm();
  const double moved = (next.center_F - center_F).norm() + turned * radius_B;
  const double scale = center_F.norm() + next.center_F.norm() + radius + center_B.norm();
  return moved + (drift + next.drift) * extent + kRounding * scale;
}

void PosedObjects::close(ObjectGroup* group) const {
  Eigen::AlignedBox3d box;
  for (std::size_t i = group->first; i < group->last; ++i) {
    const KnownWorld::Object& object = *objects_[i].object;
    const ObjectSphere sphere(object);
    box.extend(Eigen::Vector3d(sphere.center_B.array() - sphere.radius));
    box.extend(Eigen::Vector3d(sphere.center_B.array() + sphere.radius));
    const Eigen::AlignedBox3d& own = object.shape->surface.box;
    group->extent = std::max(group->extent, own.center().norm() + 0.5 * own.sizes().norm());
    group->drift_B = std::max(group->drift_B, sphere.drift);
    group->margin = std::max(group->margin, object.margin);
  }
  group->center_B = box.center();
  for (std::size_t i = group->first; i < group->last; ++i) {
    const ObjectSphere sphere(*objects_[i].object);
    const double reach = (sphere.center_B - group->center_B).norm() + sphere.radius;
    group->radius_B = std::max(group->radius_B, reach);
  }
  group->radius_B += kRounding * (group->center_B.norm() + group->radius_B + group->extent);
  group->place(worlds_[group->world].X_FB[group->frame]);
}

// Lists the objects of a world, those of a group side by side.
void PosedObjects::list(std::uint32_t w) {
  const KnownWorld& world = *worlds_[w].world;
  std::vector<std::vector<HierarchyChild>> boxes(world.frames().size());
  for (const KnownWorld::Object& object : world.objects()) {
    const ObjectSphere sphere(object);
    const Eigen::Array4f center(static_cast<float>(sphere.center_B.x()),
                                static_cast<float>(sphere.center_B.y()),
                                static_cast<float>(sphere.center_B.z()), 0.0F);
    const auto index = static_cast<std::int32_t>(&object - world.objects().data());
    boxes[object.frame].push_back({{center, center}, index});
  }
  BoxHierarchy hierarchy;
  for (std::size_t frame = 0; frame < boxes.size(); ++frame) {
    const std::vector<std::uint32_t>& order = hierarchy.arrange(boxes[frame]);
    for (std::size_t i = 0; i < order.size(); ++i) {
      if (i % kGroupSize == 0) {
        groups_.emplace_back();
        groups_.back().world = w;
        groups_.back().frame = frame;
        groups_.back().first = objects_.size();
      }
      const auto index = static_cast<std::uint32_t>(boxes[frame][order[i]].child);
      objects_.emplace_back();
      objects_.back().object = &world.objects()[index];
      objects_.back().world = w;
      objects_.back().index = index;
      groups_.back().last = objects_.size();
    }
  }
}

bool PosedObjects::take(Span<const PosedWorld* const> given) {
  placements_ = 0;
  const bool are_same = std::equal(
      given.begin(), given.end(), worlds_.begin(), worlds_.end(),
      [](const PosedWorld* one, const PosedWorld& other) { return one->world == other.world; });
  if (are_same) {
    move(given);
    return false;
  }
  objects_.clear();
  groups_.clear();
  ++generation_;
  path_ = 0.0;
  worlds_.resize(given.size());
  for (std::size_t w = 0; w < given.size(); ++w) {
    worlds_[w] = *given[w];
    if (worlds_[w].world) list(static_cast<std::uint32_t>(w));
  }
  for (ObjectGroup& group : groups_) close(&group);
  return true;
}

void PosedObjects::place(ObjectGroup* group) {
  if (group->is_placed) return;
  group->is_placed = true;
  for (std::size_t i = group->first; i < group->last; ++i) {
    const KnownWorld::Object& object = *objects_[i].object;
    objects_[i].place(worlds_[group->world].X_FB[object.frame] * object.X_BO);
    ++placements_;
  }
}

// Places the groups of frames that have moved, and their objects where these are placed.
void PosedObjects::move(Span<const PosedWorld* const> given) {
  double farthest = 0.0;
  for (ObjectGroup& group : groups_) {
    const Eigen::Isometry3d& X_FB = given[group.world]->X_FB[group.frame];
    Eigen::Isometry3d& before = worlds_[group.world].X_FB[group.frame];
    group.has_moved = X_FB.matrix() != before.matrix();
    if (group.has_moved) farthest = std::max(farthest, group.moves_at_most(before, X_FB));
  }
  for (ObjectGroup& group : groups_) {
    if (!group.has_moved) continue;
    worlds_[group.world].X_FB[group.frame] = given[group.world]->X_FB[group.frame];
    group.place(worlds_[group.world].X_FB[group.frame]);
    const bool has_objects = group.is_placed;
    group.is_placed = false;
    if (has_objects) place(&group);
  }
  path_ += farthest;
  if (!(path_ < kLongestPath)) {  // the lists are made anew
    path_ = 0.0;
    ++generation_;
  }
}

}  // namespace ist
