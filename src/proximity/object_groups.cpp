#include "proximity/object_groups.h"

#include <algorithm>
#include <numeric>

#include "internal/geometry/relative_pose.h"
#include "proximity/world_shape.h"

namespace ist {
namespace {

// Of all coordinates involved: the rounding of a sphere about boxes.
constexpr double kRounding = 1e-14;

// [m] The sphere about an object's box, in B.
struct ObjectSphere {
  Eigen::Vector3d center;
  double radius, drift;
};

ObjectSphere sphere_of(const KnownWorld::Object& object) {
  const Eigen::AlignedBox3d& box = object.shape->box;
  const double drift = nearest_rigid(object.X_BO).drift;
  // No singular value of the linear part exceeds 1 + drift / 2.
  return {object.X_BO * box.center(), 0.5 * box.sizes().norm() * (1.0 + drift), drift};
}

// Divides objects by the middle of their longest side, until groups are small enough.
class Divider {
 public:
  /// @param spheres  by object
  Divider(const KnownWorld& world, const std::vector<ObjectSphere>& spheres, std::size_t frame,
          ObjectGroups* out)
      : world_(world), spheres_(spheres), frame_(frame), out_(*out) {}

  void divide(std::size_t first, std::size_t last) {
    if (first == last) return;
    if (last - first <= ObjectGroups::kSize) return close(first, last);
    Eigen::AlignedBox3d box;
    for (std::size_t m = first; m < last; ++m) box.extend(spheres_[out_.members[m]].center);
    Eigen::Index axis = 0;
    box.sizes().maxCoeff(&axis);
    const std::size_t middle = first + (last - first) / 2;
    const auto at = [&](std::size_t m) {
      return out_.members.begin() + static_cast<std::ptrdiff_t>(m);
    };
    std::nth_element(at(first), at(middle), at(last), [&](std::uint32_t i, std::uint32_t k) {
      return spheres_[i].center[axis] < spheres_[k].center[axis];
    });
    divide(first, middle);
    divide(middle, last);
  }

 private:
  void close(std::size_t first, std::size_t last) {
    ObjectGroup group;
    group.frame = frame_;
    group.first = first;
    group.last = last;
    Eigen::AlignedBox3d box;
    for (std::size_t m = first; m < last; ++m) {
      const KnownWorld::Object& object = world_.objects()[out_.members[m]];
      const ObjectSphere& sphere = spheres_[out_.members[m]];
      box.extend(Eigen::Vector3d(sphere.center.array() - sphere.radius));
      box.extend(Eigen::Vector3d(sphere.center.array() + sphere.radius));
      const Eigen::AlignedBox3d& own = object.shape->box;
      group.extent = std::max(group.extent, own.center().norm() + 0.5 * own.sizes().norm());
      group.drift = std::max(group.drift, sphere.drift);
      group.margin = std::max(group.margin, object.margin);
    }
    group.center_B = box.center();
    for (std::size_t m = first; m < last; ++m) {
      const ObjectSphere& sphere = spheres_[out_.members[m]];
      const double reach = (sphere.center - group.center_B).norm() + sphere.radius;
      group.radius = std::max(group.radius, reach);
    }
    group.radius += kRounding * (group.center_B.norm() + group.radius + group.extent);
    out_.groups.push_back(group);
  }

  const KnownWorld& world_;
  const std::vector<ObjectSphere>& spheres_;
  const std::size_t frame_;
  ObjectGroups& out_;
};

}  // namespace

ObjectGroups::ObjectGroups(const KnownWorld& world) : members(world.objects().size()) {
  const std::vector<KnownWorld::Object>& objects = world.objects();
  std::vector<std::size_t> first(world.frames().size() + 1, 0);
  for (const KnownWorld::Object& object : objects) ++first[object.frame + 1];
  std::partial_sum(first.begin(), first.end(), first.begin());
  std::vector<std::size_t> next(first.begin(), first.end() - 1);
  std::vector<ObjectSphere> spheres;
  spheres.reserve(objects.size());
  for (std::uint32_t i = 0; i < objects.size(); ++i) {
    members[next[objects[i].frame]++] = i;
    spheres.push_back(sphere_of(objects[i]));
    if (!objects[i].allowed_links.empty()) touchable.push_back(i);
    const WorldShape& shape = *objects[i].shape;
    most_nodes = std::max(most_nodes, shape.link.tree.nodes().size());
    if (!shape.surface.opening_cells.empty()) open = &shape;
  }
  for (std::size_t frame = 0; frame + 1 < first.size(); ++frame) {
    first_group.push_back(groups.size());
    Divider(world, spheres, frame, this).divide(first[frame], first[frame + 1]);
  }
  first_group.push_back(groups.size());
}

}  // namespace ist
