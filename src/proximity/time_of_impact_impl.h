#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "internal/geometry/numbers.h"
#include "internal/proximity/carried_worlds.h"
#include "ist_proximity/proximity/time_of_impact.h"
#include "proximity/conservative_advancement.h"
#include "proximity/robot_surfaces.h"

namespace ist {

/// The obstacles of a link on its way.
struct ImpactObstacles {
  SnapshotSpan clouds;
  Span<const PosedWorld* const> worlds;
};

/// Distances of a moved robot's links, and bounds of their motion.
struct TimeOfImpact::Impl {
  Impl(std::shared_ptr<const RobotModel> robot, std::shared_ptr<const Kinematics> tree,
       const QueryConfig& query_config)
      : model(std::move(robot)),
        moved(*model, std::move(tree)),
        config(query_config),
        query(model, config),
        moving(model->links.size(), false) {
    config.deadline = 0.0;
  }

  class Piece;  ///< of a trajectory

  /// A proven lower bound of the distance [m]; NaN where nothing is known.
  double measure(std::size_t link, const ImpactObstacles& obstacles, double tolerance) {
    const LinkPoses& links = moved.forward().links();
    if (!links.known[link]) return kNaN;
    config.tolerance = tolerance;
    double bound = std::numeric_limits<double>::infinity();
    const auto take = [&] {
      const bool is_known = answers[link].state != LinkState::kUnknown;
      bound = is_known && !std::isnan(bound) ? std::min(bound, answers[link].lower_bound) : kNaN;
    };
    if (!obstacles.clouds.empty() || obstacles.worlds.empty()) {
      query.set_config(config);
      query.run(links.X_FL, moving, obstacles.clouds, &answers);
      take();
    }
    if (!obstacles.worlds.empty()) {
      worlds->set_config(config);
      worlds->run(links.X_FL, moving, obstacles.worlds, TimePoint::max(), &answers);
      take();
    }
    return bound;
  }

  /// [m] The radius of a sphere about the centre of a link's tree, which encloses all of the link
  /// that is measured.
  double radius(std::size_t link, const ImpactObstacles& obstacles) const {
    const InnerSphereTree& tree = model->links[link].tree;
    if (obstacles.worlds.empty()) return tree.radius();
    const LinkSurface* surface = worlds->robot()->surfaces[link].get();
    if (surface == nullptr) return tree.radius();
    const Eigen::AlignedBox3d& box = surface->box;
    const Eigen::Vector3d c = tree.center();
    return std::max(tree.radius(),
                    (box.min() - c).cwiseAbs().cwiseMax((box.max() - c).cwiseAbs()).norm());
  }

  // Bounds the motion of the objects that the robot carries, by frame.
  void bound_carried() {
    carried_bounds.clear();
    for (const CarriedWorlds::Frame& frame : carried.frames()) {
      carried_bounds.push_back(moved.bound(frame.body, frame.center_B, frame.radius));
    }
  }

  // [m/s] No point of the link and no object come nearer to each other faster than this now.
  double speed(const MotionBound& link) const {
    const std::vector<Eigen::Isometry3d>& X_FB = moved.forward().bodies().X_FB;
    double carried_speed = 0.0;  // link and object may both move
    for (const MotionBound& object : carried_bounds) {
      carried_speed = std::max(carried_speed, object.speed(X_FB));
    }
    return link.speed(X_FB) + carried_speed;
  }

  MotionBound bound(std::size_t link, const ImpactObstacles& obstacles) const {
    return moved.bound(*moved.forward().body(link), model->links[link].tree.center(),
                       radius(link, obstacles));
  }

  void place(double time, const Eigen::Isometry3d& X_FR) {
    moved.place(time, X_FR);
    carried.place(moved.forward().bodies());
  }

  ImpactTime find(std::size_t link, const Eigen::Isometry3d& X_FR,
                  const ImpactObstacles& obstacles) {
    const MotionBound motion = bound(link, obstacles);
    return advance(
        moved.duration(),
        [&](double time, double tolerance) {
          place(time, X_FR);
          return measure(link, obstacles, tolerance);
        },
        [&](double distance) { return time_within(distance, speed(motion)); });
  }

  std::shared_ptr<const RobotModel> model;
  MovedRobot moved;
  QueryConfig config;
  ProximityQuery query;
  std::unique_ptr<WorldQuery> worlds;  ///< null: no surfaces are set
  CarriedWorlds carried;

  // Buffers of one call.
  std::vector<bool> moving;                 // by link: the one that is being advanced
  std::vector<MotionBound> carried_bounds;  // by frame of what the robot carries
  std::vector<LinkProximity> answers;
};

}  // namespace ist
