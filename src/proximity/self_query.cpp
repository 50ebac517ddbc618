#include "ist_proximity/proximity/self_query.h"

#include <algorithm>
#include <limits>

#include "internal/geometry/cancelled.h"
#include "internal/geometry/numbers.h"
#include "internal/geometry/relative_pose.h"
#include "internal/proximity/deadline.h"
#include "proximity/link_pair_query.h"
#include "proximity/link_surface.h"
#include "proximity/within_reach.h"

namespace ist {
namespace {

// Pairs of boxes that a pair of links looks at before the clock is read: some tens of microseconds.
constexpr int kSlice = 256;

bool can_query(const LinkModel& link) { return link.usable() && !link.tree.empty(); }

}  // namespace

void PairProximity::reset() {
  state = LinkState::kUnknown;
  distance = kNaN;
  lower_bound = -std::numeric_limits<double>::infinity();
  p_FCa = p_FCb = direction = Eigen::Vector3d::Constant(kNaN);
  finished = true;
  decided = false;
}

struct SelfQuery::Impl {
  // A pair that is not finished.
  struct Waiting {
    double bound;
    std::size_t pair;
    bool operator<(const Waiting& other) const { return bound > other.bound; }  // least on top
  };

  void prepare(const CancelRequest& cancelled);
  bool finish(std::size_t pair, int steps);
  bool finish_by(Deadline* deadline);

  std::shared_ptr<const RobotModel> model;
  std::vector<LinkPair> pairs;
  QueryConfig config;
  SelfQueryStatistics statistics;
  // By link; null where no pair needs it.
  std::vector<std::shared_ptr<const LinkSurface>> surfaces;
  std::vector<std::unique_ptr<LinkPairQuery>> queries;  // by pair; null where a link is unusable
  std::vector<RigidPose> X_FL;                          // by link
  std::vector<bool> has_pose;                           // by link: X_FL is known and finite
  std::vector<Waiting> queue;                           // a heap
};

void SelfQuery::Impl::prepare(const CancelRequest& cancelled) {
  const auto& links = model->links;
  surfaces.resize(links.size());
  X_FL.resize(links.size());
  has_pose.resize(links.size());
  for (const LinkPair& pair : pairs) {
    queries.emplace_back();
    if (std::max(pair.first, pair.second) >= links.size()) continue;
    if (!can_query(links[pair.first]) || !can_query(links[pair.second])) continue;
    for (const std::size_t i : {pair.first, pair.second}) {
      if (!surfaces[i]) surfaces[i] = LinkSurface::of(links[i], cancelled);
    }
    queries.back() = std::make_unique<LinkPairQuery>(links[pair.first], links[pair.second],
                                                     *surfaces[pair.first], *surfaces[pair.second]);
  }
  queue.reserve(pairs.size());
}

SelfQuery::SelfQuery(std::shared_ptr<const RobotModel> model, std::vector<LinkPair> pairs,
                     const QueryConfig& config, const std::function<bool()>& cancelled)
    : impl_(std::make_unique<Impl>()) {
  impl_->model = std::move(model);
  impl_->pairs = std::move(pairs);
  set_config(config);
  try {
    impl_->prepare(cancelled);
  } catch (const Cancelled&) {
    impl_->queries.clear();
    impl_->queries.resize(impl_->pairs.size());
  }
}
SelfQuery::~SelfQuery() = default;
SelfQuery::SelfQuery(SelfQuery&&) noexcept = default;
SelfQuery& SelfQuery::operator=(SelfQuery&&) noexcept = default;

void SelfQuery::set_config(const QueryConfig& config) { impl_->config = within_reach(config); }

const std::vector<LinkPair>& SelfQuery::pairs() const { return impl_->pairs; }

const SelfQueryStatistics& SelfQuery::statistics() const { return impl_->statistics; }

bool SelfQuery::Impl::finish(std::size_t pair, int steps) {
  int left = steps;
  const bool finished = queries[pair]->advance(&left);
  statistics.steps += static_cast<std::uint64_t>(steps - left);
  return finished;
}

// The pair with the least bound goes on, until all are finished or the time is over.
bool SelfQuery::Impl::finish_by(Deadline* deadline) {
  while (!queue.empty() && !deadline->passed()) {
    std::pop_heap(queue.begin(), queue.end());
    const std::size_t pair = queue.back().pair;
    queue.pop_back();
    if (finish(pair, kSlice)) continue;
    queue.push_back({queries[pair]->lower_bound(), pair});
    std::push_heap(queue.begin(), queue.end());
  }
  return queue.empty();
}

bool SelfQuery::run(Span<const Eigen::Isometry3d> X_FL, const std::vector<bool>& known,
                    std::vector<PairProximity>* results) {
  Impl& impl = *impl_;
  results->resize(impl.pairs.size());
  for (PairProximity& result : *results) result.reset();
  if (X_FL.size() != impl.model->links.size() || known.size() != X_FL.size()) return true;
  Deadline deadline(impl.config.deadline);
  impl.statistics = {};
  for (std::size_t i = 0; i < X_FL.size(); ++i) {
    impl.has_pose[i] = known[i] && X_FL[i].matrix().allFinite();
    if (impl.has_pose[i]) impl.X_FL[i] = nearest_rigid(X_FL[i]);
  }
  const auto can_run = [&](std::size_t i) {
    const LinkPair& pair = impl.pairs[i];
    return impl.queries[i] && impl.has_pose[pair.first] && impl.has_pose[pair.second];
  };
  impl.queue.clear();
  for (std::size_t i = 0; i < impl.pairs.size(); ++i) {
    if (!can_run(i)) continue;
    const LinkPair& pair = impl.pairs[i];
    impl.queries[i]->move_to(impl.X_FL[pair.first], impl.X_FL[pair.second], impl.config);
    const std::uint64_t before = impl.statistics.steps;
    if (impl.config.deadline > 0.0) {
      impl.queue.push_back({impl.queries[i]->lower_bound(), i});
    } else {
      impl.finish(i, std::numeric_limits<int>::max());
    }
    impl.statistics.pairs_searched += impl.statistics.steps > before ? 1 : 0;
  }
  std::make_heap(impl.queue.begin(), impl.queue.end());
  const bool all = impl.finish_by(&deadline);
  for (std::size_t i = 0; i < impl.pairs.size(); ++i) {
    if (can_run(i)) impl.queries[i]->report(&(*results)[i]);
  }
  return all;
}

}  // namespace ist
