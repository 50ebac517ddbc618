#include "internal/proximity/carried_worlds.h"

#include <algorithm>
#include <limits>
#include <optional>

#include "proximity/object_groups.h"

namespace ist {
namespace {

bool is_moved_by_joints(const Kinematics& kinematics, std::size_t body) {
  for (; body > 0; body = kinematics.joints()[body - 1].parent) {
    if (kinematics.joints()[body - 1].type != JointType::kFixed) return true;
  }
  return false;
}

// Sets the sphere about the objects of a frame.
void enclose(const KnownWorld& world, CarriedWorlds::Frame* frame) {
  const ObjectGroups& all = *world.groups();
  const std::size_t first = all.first_group[frame->frame], end = all.first_group[frame->frame + 1];
  Eigen::AlignedBox3d box;
  for (std::size_t g = first; g < end; ++g) {
    const Eigen::Array3d center = all.groups[g].center_B;
    box.extend((center - all.groups[g].radius).matrix());
    box.extend((center + all.groups[g].radius).matrix());
  }
  frame->center_B = box.center();
  for (std::size_t g = first; g < end; ++g) {
    const double reach = (all.groups[g].center_B - frame->center_B).norm() + all.groups[g].radius;
    frame->radius = std::max(frame->radius, reach);
  }
}

}  // namespace

void CarriedWorlds::take(Span<const PosedWorld* const> worlds, const Kinematics& kinematics) {
  frames_.clear();
  copies_.clear();
  copies_.reserve(worlds.size());
  worlds_.assign(worlds.begin(), worlds.end());
  copy_of_.assign(worlds.size(), 0);
  for (std::size_t w = 0; w < worlds.size(); ++w) {
    const KnownWorld* world = worlds[w]->world.get();
    if (world == nullptr || world->groups() == nullptr) continue;
    for (std::size_t f = 0; f < world->frames().size(); ++f) {
      const std::optional<std::size_t> body = kinematics.find_body(world->frames()[f]);
      if (!body || !is_moved_by_joints(kinematics, *body)) continue;
      if (worlds_[w] == worlds[w]) {
        copy_of_[w] = copies_.size();
        copies_.push_back(*worlds[w]);
        worlds_[w] = &copies_.back();
      }
      frames_.push_back({w, f, *body});
      enclose(*world, &frames_.back());
    }
  }
}

void CarriedWorlds::place(const BodyPoses& bodies) {
  for (const Frame& carried : frames_) {
    std::vector<Eigen::Isometry3d>& X_FB = copies_[copy_of_[carried.world]].X_FB;
    if (carried.frame >= X_FB.size()) continue;  // the world has no poses
    if (bodies.known[carried.body]) {
      X_FB[carried.frame] = bodies.X_FB[carried.body];
    } else {
      X_FB[carried.frame].matrix().setConstant(std::numeric_limits<double>::quiet_NaN());
    }
  }
}

}  // namespace ist
