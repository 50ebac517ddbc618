#include "ist_proximity/proximity/time_of_impact.h"

#include <algorithm>
#include <cmath>

#include "internal/geometry/numbers.h"
#include "internal/proximity/carried_worlds.h"
#include "proximity/conservative_advancement.h"
#include "proximity/robot_surfaces.h"

namespace ist {
namespace {

struct Obstacles {
  SnapshotSpan clouds;
  Span<const PosedWorld* const> worlds;
};

}  // namespace

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

  /// A proven lower bound of the distance [m]; NaN where nothing is known.
  double measure(std::size_t link, const Obstacles& obstacles, double tolerance) {
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
  double radius(std::size_t link, const Obstacles& obstacles) const {
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

  // [s] The link and no object come nearer to each other by `distance` [m] within this time.
  double time_for(const MotionBound& link, double distance) const {
    const std::vector<Eigen::Isometry3d>& X_FB = moved.forward().bodies().X_FB;
    if (carried_bounds.empty()) return link.time_for(distance, X_FB);
    const double half = 0.5 * distance;  // link and object may both move
    double time = link.time_for(half, X_FB);
    for (const MotionBound& object : carried_bounds) {
      time = std::min(time, object.time_for(half, X_FB));
    }
    return time;
  }

  ImpactTime find(std::size_t link, const Eigen::Isometry3d& X_FR, const Obstacles& obstacles) {
    const MotionBound bound = moved.bound(
        *moved.forward().body(link), model->links[link].tree.center(), radius(link, obstacles));
    return advance(
        moved.duration(),
        [&](double time, double tolerance) {
          moved.place(time, X_FR);
          carried.place(moved.forward().bodies());
          return measure(link, obstacles, tolerance);
        },
        [&](double distance) { return time_for(bound, distance); });
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

TimeOfImpact::TimeOfImpact(std::shared_ptr<const RobotModel> model,
                           std::shared_ptr<const Kinematics> kinematics, const QueryConfig& config)
    : impl_(std::make_unique<Impl>(std::move(model), std::move(kinematics), config)) {}
TimeOfImpact::~TimeOfImpact() = default;
TimeOfImpact::TimeOfImpact(TimeOfImpact&&) noexcept = default;
TimeOfImpact& TimeOfImpact::operator=(TimeOfImpact&&) noexcept = default;

void TimeOfImpact::set_config(const QueryConfig& config) {
  impl_->config = config;
  impl_->config.deadline = 0.0;
}

void TimeOfImpact::run(const JointMotion& motion, const JointPoses& still,
                       const Eigen::Isometry3d& X_FR, const std::vector<bool>& wanted,
                       SnapshotSpan clouds, std::vector<ImpactTime>* results) {
  run(motion, still, X_FR, wanted, clouds, {}, results);
}

void TimeOfImpact::set_surfaces(std::shared_ptr<const RobotSurfaces> surfaces,
                                std::vector<double> margins) {
  if (!impl_->worlds || impl_->worlds->robot() != surfaces) {
    impl_->worlds = std::make_unique<WorldQuery>(std::move(surfaces), impl_->config);
  }
  impl_->worlds->set_link_margins(std::move(margins));
}

void TimeOfImpact::run(const JointMotion& motion, const JointPoses& still,
                       const Eigen::Isometry3d& X_FR, const std::vector<bool>& wanted,
                       SnapshotSpan clouds, Span<const PosedWorld* const> worlds,
                       std::vector<ImpactTime>* results) {
  const std::size_t count = impl_->model->links.size();
  const ForwardKinematics& forward = impl_->moved.forward();
  results->assign(count, ImpactTime());
  if (!worlds.empty() && !impl_->worlds) return;
  if (wanted.size() != count || !impl_->moved.begin(motion, still)) return;
  impl_->carried.take(worlds, forward.kinematics());
  impl_->bound_carried();
  for (std::size_t i = 0; i < count; ++i) {
    if (!wanted[i] || !forward.body(i) || !impl_->model->links[i].usable()) continue;
    impl_->moving[i] = true;
    (*results)[i] = impl_->find(i, X_FR, {clouds, impl_->carried.worlds()});
    impl_->moving[i] = false;
  }
}

}  // namespace ist
