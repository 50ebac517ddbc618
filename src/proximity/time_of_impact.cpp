#include "ist_proximity/proximity/time_of_impact.h"

#include "proximity/time_of_impact_impl.h"

namespace ist {

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
