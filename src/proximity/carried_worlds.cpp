#include "internal/proximity/carried_worlds.h"

#include <algorithm>
#include <limits>
#include <optional>

#include "proximity/world_shape.h"

namespace ist {
namespace {

bool is_moved_by_joints(const Kinematics& kinematics, std::size_t body) {
  for (; body > 0; body = kinematics.joints()[body - 1].parent) {
    if (kinematics.joints()[body - 1].type != JointType::kFixed) return true;
  }
  return false;
}

// Sets the sphere about the objects of a frame: it holds the corners of their boxes.
void enclose(const KnownWorld& world, CarriedWorlds::Frame* frame) {
  Eigen::AlignedBox3d box;
  const auto for_each_corner = [&](const auto& visit) {
    for (const KnownWorld::Object& object : world.objects()) {
      if (object.frame != frame->frame) continue;
      for (int k = 0; k < 8; ++k) {
        const auto corner = static_cast<Eigen::AlignedBox3d::CornerType>(k);
        visit(Eigen::Vector3d(object.X_BO * object.shape->surface.box.corner(corner)));
      }
    }
  };
  for_each_corner([&](const Eigen::Vector3d& p_B) { box.extend(p_B); });
  frame->center_B = box.center();
  for_each_corner([&](const Eigen::Vector3d& p_B) {
    const double rounding = 1e-14 * (p_B.norm() + frame->center_B.norm());
    frame->radius = std::max(frame->radius, (p_B - frame->center_B).norm() + rounding);
  });
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
    if (world == nullptr) continue;
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
