#include "ist_proximity/proximity/time_of_self_impact.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "ist_proximity/robot/link_poses.h"
#include "proximity/motion_bound.h"
#include "proximity/moved_joints.h"

namespace ist {
namespace {

constexpr double kTouch = 1e-6;  // [m] a bound below it is contact
constexpr int kMaxSteps = 4000;
// Tolerance of the next distance: as a ratio to the last bound, and in [m] at the first step.
constexpr double kRelativeTolerance = 0.1, kFirstTolerance = 0.01;

// The nearest body that both hang on. A body's number is above its parent's.
std::size_t common_body(const Kinematics& kinematics, std::size_t a, std::size_t b) {
  while (a != b) {
    std::size_t& lower = a > b ? a : b;
    lower = kinematics.joints()[lower - 1].parent;
  }
  return a;
}

}  // namespace

struct TimeOfSelfImpact::Impl {
  Impl(std::shared_ptr<const RobotModel> robot, std::shared_ptr<const Kinematics> tree,
       std::vector<LinkPair> link_pairs, const QueryConfig& query_config)
      : model(std::move(robot)),
        forward(*model, std::move(tree)),
        config(query_config),
        pairs(std::move(link_pairs)) {
    config.deadline = 0.0;
    queries.resize(pairs.size());
  }

  // A query of one pair, made when it is first asked for; hierarchies are shared by link.
  SelfQuery& query_of(std::size_t pair) {
    if (!queries[pair]) {
      queries[pair] =
          std::make_unique<SelfQuery>(model, std::vector<LinkPair>{pairs[pair]}, config);
    }
    return *queries[pair];
  }

  PairProximity measure(std::size_t pair, double tolerance) {
    config.tolerance = tolerance;
    SelfQuery& query = query_of(pair);
    query.set_config(config);
    query.run(forward.links().X_FL, forward.links().known, &answer);
    return answer[0];
  }

  MotionBound bound_of(std::size_t link, std::size_t ancestor, const JointMotion& motion,
                       const JointPoses& still) const {
    const InnerSphereTree& tree = model->links[link].tree;
    return {forward.kinematics(), motion,        still,   *forward.body(link),
            tree.center(),        tree.radius(), ancestor};
  }

  // Conservative advancement of one pair.
  ImpactTime find(std::size_t pair, const JointMotion& motion, const JointPoses& still) {
    constexpr double kInf = std::numeric_limits<double>::infinity();
    ImpactTime impact;
    const auto [a, b] = pairs[pair];
    const std::size_t common =
        common_body(forward.kinematics(), *forward.body(a), *forward.body(b));
    const MotionBound of_a = bound_of(a, common, motion, still);
    const MotionBound of_b = bound_of(b, common, motion, still);
    double time = 0.0, tolerance = kFirstTolerance;
    for (; impact.steps < kMaxSteps; ++impact.steps) {
      place_moved_joints(forward.kinematics(), motion, still, time, &moved);
      forward.run(moved);
      PairProximity found = measure(pair, tolerance);
      if (found.lower_bound <= kTouch && tolerance > 0.0) found = measure(pair, 0.0);
      if (found.state == LinkState::kUnknown) return ImpactTime();
      impact.time = time;
      if (found.lower_bound <= kTouch) return impact;
      time += time_within(found.lower_bound,
                          of_a.speed(forward.bodies().X_FB) + of_b.speed(forward.bodies().X_FB),
                          of_a.growth() + of_b.growth());
      if (time >= motion.duration) {
        impact.time = kInf;
        return impact;
      }
      tolerance = std::min(kFirstTolerance, kRelativeTolerance * found.lower_bound);
    }
    impact.converged = false;
    return impact;
  }

  std::shared_ptr<const RobotModel> model;
  ForwardKinematics forward;
  QueryConfig config;
  std::vector<LinkPair> pairs;
  std::vector<std::unique_ptr<SelfQuery>> queries;  // by pair

  // Buffers of one call.
  JointMotion full_motion;  // with the positions of mimic joints
  JointPoses moved;
  std::vector<PairProximity> answer;
};

TimeOfSelfImpact::TimeOfSelfImpact(std::shared_ptr<const RobotModel> model,
                                   std::shared_ptr<const Kinematics> kinematics,
                                   std::vector<LinkPair> pairs, const QueryConfig& config)
    : impl_(std::make_unique<Impl>(std::move(model), std::move(kinematics), std::move(pairs),
                                   config)) {}
TimeOfSelfImpact::~TimeOfSelfImpact() = default;
TimeOfSelfImpact::TimeOfSelfImpact(TimeOfSelfImpact&&) noexcept = default;
TimeOfSelfImpact& TimeOfSelfImpact::operator=(TimeOfSelfImpact&&) noexcept = default;

const std::vector<LinkPair>& TimeOfSelfImpact::pairs() const { return impl_->pairs; }

void TimeOfSelfImpact::set_config(const QueryConfig& config) {
  impl_->config = config;
  impl_->config.deadline = 0.0;
}

void TimeOfSelfImpact::run(const JointMotion& stated, const JointPoses& still,
                           const std::vector<bool>& wanted, std::vector<ImpactTime>* results) {
  const std::size_t joints = impl_->forward.kinematics().joints().size();
  results->assign(impl_->pairs.size(), ImpactTime());
  const bool fits = wanted.size() == impl_->pairs.size() && stated.from.size() == joints &&
                    stated.to.size() == joints && still.X_PC.size() == joints &&
                    still.known.size() == joints;
  if (!fits || !(stated.duration > 0.0) || !std::isfinite(stated.duration)) return;
  JointMotion& motion = impl_->full_motion;
  motion = stated;
  place_mimics(impl_->forward.kinematics(), &motion);
  const auto can_measure = [&](std::size_t link) {
    return link < impl_->model->links.size() && impl_->model->links[link].usable() &&
           impl_->forward.body(link).has_value();
  };
  for (std::size_t i = 0; i < impl_->pairs.size(); ++i) {
    const LinkPair& pair = impl_->pairs[i];
    if (!wanted[i] || !can_measure(pair.first) || !can_measure(pair.second)) continue;
    (*results)[i] = impl_->find(i, motion, still);
  }
}

}  // namespace ist
