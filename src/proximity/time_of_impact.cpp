#include "ist_proximity/proximity/time_of_impact.h"

#include <algorithm>
#include <cmath>

#include "internal/proximity/carried_worlds.h"
#include "ist_proximity/robot/link_poses.h"
#include "proximity/motion_bound.h"
#include "proximity/moved_joints.h"
#include "proximity/robot_surfaces.h"

namespace ist {
namespace {

constexpr double kTouch = 1e-6;  // [m] a bound below it is contact
constexpr int kMaxSteps = 4000;
// Tolerance of the next distance: as a ratio to the last bound, and in [m] at the first step.
constexpr double kRelativeTolerance = 0.1, kFirstTolerance = 0.01;

struct Obstacles {
  SnapshotSpan clouds;
  Span<const PosedWorld* const> worlds;
};

}  // namespace

struct TimeOfImpact::Impl {
  Impl(std::shared_ptr<const RobotModel> robot, std::shared_ptr<const Kinematics> tree,
       const QueryConfig& query_config)
      : model(std::move(robot)),
        forward(*model, std::move(tree)),
        config(query_config),
        query(model, config),
        moving(model->links.size(), false) {
    config.deadline = 0.0;
  }

  // Poses of all links after `time` [s].
  void place(const JointMotion& motion, const JointPoses& still, const Eigen::Isometry3d& X_FR,
             double time) {
    place_moved_joints(forward.kinematics(), motion, still, time, &moved);
    forward.run(moved, X_FR);
    carried.place(forward.bodies());
  }

  /// A proven lower bound of the distance [m]; NaN where nothing is known.
  double measure(std::size_t link, const Obstacles& obstacles, double tolerance) {
    config.tolerance = tolerance;
    double bound = std::numeric_limits<double>::infinity();
    const auto take = [&] {
      const bool is_known = answers[link].state != LinkState::kUnknown;
      bound = is_known && !std::isnan(bound) ? std::min(bound, answers[link].lower_bound)
                                             : std::numeric_limits<double>::quiet_NaN();
    };
    if (!obstacles.clouds.empty() || obstacles.worlds.empty()) {
      query.set_config(config);
      query.run(forward.links().X_FL, moving, obstacles.clouds, &answers);
      take();
    }
    if (!obstacles.worlds.empty()) {
      worlds->set_config(config);
      worlds->run(forward.links().X_FL, moving, obstacles.worlds, TimePoint::max(), &answers);
      take();
    }
    return bound;
  }

  /// [m] The radius of a sphere about the centre of a link's tree, which encloses all of the link
  /// that is measured.
  double radius(std::size_t link, const Obstacles& obstacles) const {
    const InnerSphereTree& tree = model->links[link].tree;
    if (obstacles.worlds.empty()) return tree.radius();
    const Eigen::AlignedBox3d& box = worlds->robot()->boxes[link];
    if (box.isEmpty()) return tree.radius();
    const Eigen::Vector3d c = tree.center();
    return std::max(tree.radius(),
                    (box.min() - c).cwiseAbs().cwiseMax((box.max() - c).cwiseAbs()).norm());
  }

  // Bounds the motion of the objects that the robot carries, by frame.
  void bound_carried(const JointMotion& motion, const JointPoses& still) {
    carried_bounds.clear();
    for (const CarriedWorlds::Frame& frame : carried.frames()) {
      carried_bounds.emplace_back(forward.kinematics(), motion, still, frame.body, frame.center_B,
                                  frame.radius);
    }
  }

  // [s] The link and no object come nearer to each other by `distance` [m] within this time.
  double time_for(const MotionBound& link, double distance) const {
    const std::vector<Eigen::Isometry3d>& X_FB = forward.bodies().X_FB;
    if (carried_bounds.empty()) return link.time_for(distance, X_FB);
    const double half = 0.5 * distance;  // link and object may both move
    double time = link.time_for(half, X_FB);
    for (const MotionBound& object : carried_bounds) {
      time = std::min(time, object.time_for(half, X_FB));
    }
    return time;
  }

  // Conservative advancement of one link.
  ImpactTime find(std::size_t link, const JointMotion& motion, const JointPoses& still,
                  const Eigen::Isometry3d& X_FR, const Obstacles& obstacles) {
    ImpactTime impact;
    place(motion, still, X_FR, 0.0);
    if (!forward.links().known[link]) return impact;
    const InnerSphereTree& tree = model->links[link].tree;
    const MotionBound bound(forward.kinematics(), motion, still, *forward.body(link), tree.center(),
                            radius(link, obstacles));
    double time = 0.0, tolerance = kFirstTolerance;
    for (; impact.steps < kMaxSteps; ++impact.steps) {
      if (impact.steps > 0) place(motion, still, X_FR, time);
      double distance = measure(link, obstacles, tolerance);
      if (distance <= kTouch && tolerance > 0.0) distance = measure(link, obstacles, 0.0);
      if (std::isnan(distance)) return impact;
      impact.time = time;
      if (distance <= kTouch) return impact;
      time += time_for(bound, distance);
      if (time >= motion.duration) {
        impact.time = std::numeric_limits<double>::infinity();
        return impact;
      }
      tolerance = std::min(kFirstTolerance, kRelativeTolerance * distance);
    }
    impact.converged = false;
    return impact;
  }

  std::shared_ptr<const RobotModel> model;
  ForwardKinematics forward;
  QueryConfig config;
  ProximityQuery query;
  std::unique_ptr<WorldQuery> worlds;  ///< null: no surfaces are set
  CarriedWorlds carried;

  // Buffers of one call.
  JointMotion full_motion;   // with the positions of mimic joints
  std::vector<bool> moving;  // by link: the one that is being advanced
  JointPoses moved;
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

void TimeOfImpact::run(const JointMotion& stated, const JointPoses& still,
                       const Eigen::Isometry3d& X_FR, const std::vector<bool>& wanted,
                       SnapshotSpan clouds, Span<const PosedWorld* const> worlds,
                       std::vector<ImpactTime>* results) {
  const std::size_t count = impl_->model->links.size();
  const std::size_t joints = impl_->forward.kinematics().joints().size();
  results->assign(count, ImpactTime());
  const bool fits = wanted.size() == count && stated.from.size() == joints &&
                    stated.to.size() == joints && still.X_PC.size() == joints &&
                    still.known.size() == joints;
  if (!worlds.empty() && !impl_->worlds) return;
  if (!fits || !(stated.duration > 0.0) || !std::isfinite(stated.duration)) return;
  JointMotion& motion = impl_->full_motion;
  motion = stated;
  place_mimics(impl_->forward.kinematics(), &motion);
  impl_->carried.take(worlds, impl_->forward.kinematics());
  impl_->bound_carried(motion, still);
  for (std::size_t i = 0; i < count; ++i) {
    if (!wanted[i] || !impl_->forward.body(i) || !impl_->model->links[i].usable()) continue;
    impl_->moving[i] = true;
    (*results)[i] = impl_->find(i, motion, still, X_FR, {clouds, impl_->carried.worlds()});
    impl_->moving[i] = false;
  }
}

}  // namespace ist
