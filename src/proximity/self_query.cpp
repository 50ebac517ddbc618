#include "ist_proximity/proximity/self_query.h"

#include <algorithm>
#include <limits>

#include "internal/geometry/relative_pose.h"
#include "proximity/link_pair_search.h"

namespace ist {

void PairProximity::reset() {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  state = LinkState::kUnknown;
  distance = kNaN;
  lower_bound = -std::numeric_limits<double>::infinity();
  p_FCa = p_FCb = direction = Eigen::Vector3d::Constant(kNaN);
}

struct SelfQuery::Impl {
  LinkPairSearch search(std::size_t a, std::size_t b, Span<const Eigen::Isometry3d> X_FL);
  double error(const LinkPair& pair, Span<const Eigen::Isometry3d> X_FL, double distance) const;
  void run(const LinkPair& pair, Span<const Eigen::Isometry3d> X_FL, PairProximity* result);

  std::shared_ptr<const RobotModel> model;
  std::vector<LinkPair> pairs;
  QueryConfig config;
  QueryConfig range;  // the search looks farther by the margin, which bounds have taken off
  std::vector<LinkPairSearch::Entry> queue;
};

SelfQuery::SelfQuery(std::shared_ptr<const RobotModel> model, std::vector<LinkPair> pairs,
                     const QueryConfig& config)
    : impl_(std::make_unique<Impl>()) {
  impl_->model = std::move(model);
  impl_->pairs = std::move(pairs);
  impl_->config = config;
}
SelfQuery::~SelfQuery() = default;
SelfQuery::SelfQuery(SelfQuery&&) noexcept = default;
SelfQuery& SelfQuery::operator=(SelfQuery&&) noexcept = default;

void SelfQuery::set_config(const QueryConfig& config) { impl_->config = config; }

const std::vector<LinkPair>& SelfQuery::pairs() const { return impl_->pairs; }

namespace {

// Keeps the witnesses of a search if they are nearer.
// @param X_FB  pose of the link that the search calls B
// @param sign  1 when that is the second link of the pair, -1 when it is the first
void report(const LinkPairSearch& search, const Eigen::Isometry3d& X_FB, double sign,
            PairProximity* result) {
  if (search.distance() >= result->distance) return;
  result->distance = search.distance();
  result->p_FCa = X_FB * (sign > 0.0 ? search.p_BCa() : search.p_BCb());
  result->p_FCb = X_FB * (sign > 0.0 ? search.p_BCb() : search.p_BCa());
  result->direction = sign * (X_FB.linear() * search.normal_B());
}

}  // namespace

LinkPairSearch SelfQuery::Impl::search(std::size_t a, std::size_t b,
                                       Span<const Eigen::Isometry3d> X_FL) {
  LinkPairSearch result(model->links[a], model->links[b],
                        relative_pose(nearest_rigid(X_FL[b]).X, nearest_rigid(X_FL[a]).X), range,
                        &queue);
  result.run();
  return result;
}

// [m] The error of a pair's distance by poses that are not quite rigid.
double SelfQuery::Impl::error(const LinkPair& pair, Span<const Eigen::Isometry3d> X_FL,
                              double distance) const {
  const auto extent = [&](std::size_t i) {
    const InnerSphereTree& tree = model->links[i].tree;
    return tree.center().norm() + tree.radius();
  };
  const auto drift = [&](std::size_t i) { return nearest_rigid(X_FL[i]).drift; };
  return pose_error(drift(pair.first) + drift(pair.second),
                    extent(pair.first) + extent(pair.second), distance);
}

void SelfQuery::Impl::run(const LinkPair& pair, Span<const Eigen::Isometry3d> X_FL,
                          PairProximity* result) {
  range = config;
  range.max_distance += config.margin;
  range.max_distance += error(pair, X_FL, range.max_distance);
  // The link with the smaller gap gives the tighter bound; apart, one direction is as good as the
  // other.
  const auto gap = [&](std::size_t i) { return model->links[i].packing.certificate.max_gap; };
  const bool swapped = gap(pair.second) < gap(pair.first);
  const std::size_t a = swapped ? pair.second : pair.first;
  const std::size_t b = swapped ? pair.first : pair.second;
  const double sign = swapped ? -1.0 : 1.0;
  const LinkPairSearch of_a = search(a, b, X_FL);
  double lower = of_a.lower_bound();
  result->distance = std::numeric_limits<double>::infinity();
  if (lower >= range.max_distance) {
    result->state = LinkState::kClear;
    result->lower_bound = config.max_distance;
    return;
  }
  report(of_a, X_FL[b], sign, result);
  if (lower <= 0.0) {
    const LinkPairSearch of_b = search(b, a, X_FL);
    lower = std::min(lower, of_b.lower_bound());
    report(of_b, X_FL[a], -sign, result);
  }
  result->state = result->distance < 0.0 ? LinkState::kContact : LinkState::kNear;
  result->lower_bound = lower - error(pair, X_FL, lower) - config.margin;
}

void SelfQuery::run(Span<const Eigen::Isometry3d> X_FL, const std::vector<bool>& known,
                    std::vector<PairProximity>* results) {
  const auto& links = impl_->model->links;
  const bool fits = X_FL.size() == links.size() && known.size() == links.size();
  results->resize(impl_->pairs.size());
  const auto can_query = [&](std::size_t i) {
    return fits && i < links.size() && known[i] && links[i].usable() && !links[i].tree.empty();
  };
  for (std::size_t i = 0; i < impl_->pairs.size(); ++i) {
    const LinkPair& pair = impl_->pairs[i];
    (*results)[i].reset();
    if (can_query(pair.first) && can_query(pair.second)) {
      impl_->run(pair, X_FL, &(*results)[i]);
    }
  }
}

}  // namespace ist
