#include "ist_proximity/proximity/time_of_self_impact.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "proximity/conservative_advancement.h"

namespace ist {
namespace {

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
        moved(*model, std::move(tree)),
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

  // [m] A proven lower bound of the distance; NaN where nothing is known.
  double measure(std::size_t pair, double tolerance) {
    config.tolerance = tolerance;
    SelfQuery& query = query_of(pair);
    query.set_config(config);
    const LinkPoses& links = moved.forward().links();
    query.run(links.X_FL, links.known, &answer);
    return answer[0].state == LinkState::kUnknown ? std::numeric_limits<double>::quiet_NaN()
                                                  : answer[0].lower_bound;
  }

  MotionBound bound_of(std::size_t link, std::size_t ancestor) const {
    const InnerSphereTree& tree = model->links[link].tree;
    return moved.bound(*moved.forward().body(link), tree.center(), tree.radius(), ancestor);
  }

  ImpactTime find(std::size_t pair) {
    const ForwardKinematics& forward = moved.forward();
    const auto [a, b] = pairs[pair];
    const std::size_t common =
        common_body(forward.kinematics(), *forward.body(a), *forward.body(b));
    const MotionBound of_a = bound_of(a, common), of_b = bound_of(b, common);
    return advance(
        moved.duration(),
        [&](double time, double tolerance) {
          moved.place(time);
          return measure(pair, tolerance);
        },
        [&](double distance) {
          const std::vector<Eigen::Isometry3d>& X_FB = forward.bodies().X_FB;
          return time_within(distance, of_a.speed(X_FB) + of_b.speed(X_FB));
        });
  }

  std::shared_ptr<const RobotModel> model;
  MovedRobot moved;
  QueryConfig config;
  std::vector<LinkPair> pairs;
  std::vector<std::unique_ptr<SelfQuery>> queries;  // by pair
  std::vector<PairProximity> answer;                // of the last query
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

void TimeOfSelfImpact::run(const JointMotion& motion, const JointPoses& still,
                           const std::vector<bool>& wanted, std::vector<ImpactTime>* results) {
  results->assign(impl_->pairs.size(), ImpactTime());
  if (wanted.size() != impl_->pairs.size() || !impl_->moved.begin(motion, still)) return;
  const auto can_measure = [&](std::size_t link) {
    return link < impl_->model->links.size() && impl_->model->links[link].usable() &&
           impl_->moved.forward().body(link).has_value();
  };
  for (std::size_t i = 0; i < impl_->pairs.size(); ++i) {
    const LinkPair& pair = impl_->pairs[i];
    if (!wanted[i] || !can_measure(pair.first) || !can_measure(pair.second)) continue;
    (*results)[i] = impl_->find(i);
  }
}

}  // namespace ist
