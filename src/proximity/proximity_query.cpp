#include "ist_proximity/proximity/proximity_query.h"

#include <cassert>
#include <limits>

#include "proximity/link_query.h"

namespace ist {

void LinkProximity::reset() {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  state = LinkState::kUnknown;
  distance = kNaN;
  lower_bound = -std::numeric_limits<double>::infinity();
  p_FL = p_LL = p_FO = direction = Eigen::Vector3d::Constant(kNaN);
  source = -1;
  point = 0;
}

struct ProximityQuery::Impl {
  Impl(std::shared_ptr<const RobotModel> robot, const QueryConfig& query_config)
      : model(std::move(robot)), config(query_config) {
    links.reserve(model->links.size());
    for (const LinkModel& link : model->links) links.emplace_back(link);
  }

  bool can_query(std::size_t i, const std::vector<bool>& known, bool has_clouds) const {
    return has_clouds && known[i] && model->links[i].usable() && !model->links[i].tree.empty();
  }

  std::shared_ptr<const RobotModel> model;
  QueryConfig config;
  std::vector<LinkQuery> links;
  QueryStatistics statistics;
};

ProximityQuery::ProximityQuery(std::shared_ptr<const RobotModel> model, const QueryConfig& config)
    : impl_(std::make_unique<Impl>(std::move(model), config)) {}
ProximityQuery::~ProximityQuery() = default;
ProximityQuery::ProximityQuery(ProximityQuery&&) noexcept = default;
ProximityQuery& ProximityQuery::operator=(ProximityQuery&&) noexcept = default;

bool ProximityQuery::run(const std::vector<Eigen::Isometry3d>& X_FL, const std::vector<bool>& known,
                         const std::vector<const CloudSnapshot*>& clouds,
                         std::vector<LinkProximity>* results) {
  const std::size_t count = impl_->links.size();
  assert(X_FL.size() == count && known.size() == count);
  results->resize(count);
  impl_->statistics = {};
  Deadline deadline(impl_->config.deadline);
  // All warm starts before the first descent: should the deadline pass, every link has an answer.
  for (std::size_t i = 0; i < count; ++i) {
    if (impl_->can_query(i, known, !clouds.empty())) {
      impl_->links[i].start(X_FL[i], clouds, impl_->config);
    }
  }
  bool complete = true;
  for (std::size_t i = 0; i < count; ++i) {
    if (!impl_->can_query(i, known, !clouds.empty())) {
      (*results)[i].reset();
      impl_->links[i].forget();
      continue;
    }
    complete = impl_->links[i].refine(clouds, &deadline, &impl_->statistics) && complete;
    impl_->links[i].answer(clouds, &(*results)[i]);
  }
  return complete;
}

void ProximityQuery::set_config(const QueryConfig& config) { impl_->config = config; }
const QueryConfig& ProximityQuery::config() const { return impl_->config; }
const QueryStatistics& ProximityQuery::statistics() const { return impl_->statistics; }
const RobotModel& ProximityQuery::model() const { return *impl_->model; }

bool is_rigid(const Eigen::Isometry3d& X, double tolerance) {
  const Eigen::Matrix3d error = X.linear().transpose() * X.linear() - Eigen::Matrix3d::Identity();
  // Written so that NaN fails.
  return error.cwiseAbs().maxCoeff() <= tolerance && X.linear().determinant() > 0.0 &&
         X.translation().allFinite();
}

}  // namespace ist
