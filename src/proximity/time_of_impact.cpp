#include "ist_proximity/proximity/time_of_impact.h"

#include <algorithm>
#include <cmath>

#include "ist_proximity/robot/link_poses.h"
#include "proximity/motion_bound.h"
#include "proximity/moved_joints.h"

namespace ist {
namespace {

constexpr double kTouch = 1e-6;  // [m] a bound below it is contact
constexpr int kMaxSteps = 4000;
// Tolerance of the next distance: as a ratio to the last bound, and in [m] at the first step.
constexpr double kRelativeTolerance = 0.1, kFirstTolerance = 0.01;

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
  }

  const LinkProximity& measure(std::size_t link, SnapshotSpan clouds, double tolerance) {
    config.tolerance = tolerance;
    query.set_config(config);
    query.run(forward.links().X_FL, moving, clouds, &answers);
    return answers[link];
  }

  // Conservative advancement of one link.
  ImpactTime find(std::size_t link, const JointMotion& motion, const JointPoses& still,
                  const Eigen::Isometry3d& X_FR, SnapshotSpan clouds) {
    ImpactTime impact;
    place(motion, still, X_FR, 0.0);
    if (!forward.links().known[link]) return impact;
    const InnerSphereTree& tree = model->links[link].tree;
    const MotionBound bound(forward.kinematics(), motion, still, *forward.body(link), tree.center(),
                            tree.radius());
    double time = 0.0, tolerance = kFirstTolerance;
    for (; impact.steps < kMaxSteps; ++impact.steps) {
      if (impact.steps > 0) place(motion, still, X_FR, time);
      const LinkProximity* answer = &measure(link, clouds, tolerance);
      if (answer->lower_bound <= kTouch && tolerance > 0.0) answer = &measure(link, clouds, 0.0);
      if (answer->state == LinkState::kUnknown) return impact;
      impact.time = time;
      if (answer->lower_bound <= kTouch) return impact;
      time += bound.time_for(answer->lower_bound, forward.bodies().X_FB);
      if (time >= motion.duration) {
        impact.time = std::numeric_limits<double>::infinity();
        return impact;
      }
      tolerance = std::min(kFirstTolerance, kRelativeTolerance * answer->lower_bound);
    }
    impact.converged = false;
    return impact;
  }

  std::shared_ptr<const RobotModel> model;
  ForwardKinematics forward;
  QueryConfig config;
  ProximityQuery query;

  // Buffers of one call.
  std::vector<bool> moving;  // by link: the one that is being advanced
  JointPoses moved;
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
  const std::size_t count = impl_->model->links.size();
  const std::size_t joints = impl_->forward.kinematics().joints().size();
  results->assign(count, ImpactTime());
  const bool fits = wanted.size() == count && motion.from.size() == joints &&
                    motion.to.size() == joints && still.X_PC.size() == joints &&
                    still.known.size() == joints;
  if (!fits || !(motion.duration > 0.0) || !std::isfinite(motion.duration)) return;
  for (std::size_t i = 0; i < count; ++i) {
    if (!wanted[i] || !impl_->forward.body(i) || !impl_->model->links[i].usable()) continue;
    impl_->moving[i] = true;
    (*results)[i] = impl_->find(i, motion, still, X_FR, clouds);
    impl_->moving[i] = false;
  }
}

}  // namespace ist
