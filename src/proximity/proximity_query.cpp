#include "ist_proximity/proximity/proximity_query.h"

#include <algorithm>
#include <limits>

#include "internal/geometry/numbers.h"
#include "proximity/coherence/scene_tracker.h"
#include "proximity/link_query.h"
#include "proximity/within_reach.h"

namespace ist {
namespace {

// [m] A finished lower bound may be this much lower than the tolerance asks for: 0.2 um by rounding
// for each metre of coordinates, of which there are no more than ten in a robot's work.
constexpr double kBoundError = 2e-6;
// [s] Links of which nothing is known yet may exceed the deadline by so much together, until each
// has an obstacle that was measured: an answer that is as late is worth more than none.
constexpr double kFirstObstacles = 5e-5;

}  // namespace

void LinkProximity::reset() {
  state = LinkState::kUnknown;
  distance = kNaN;
  lower_bound = -std::numeric_limits<double>::infinity();
  p_FCl = p_LCl = p_FCo = direction = Eigen::Vector3d::Constant(kNaN);
  sensor_width = margin = 0.0;
  source = -1;
  point = 0;
}

struct ProximityQuery::Impl {
  Impl(std::shared_ptr<const RobotModel> robot, const QueryConfig& query_config)
      : model(std::move(robot)), config(within_reach(query_config)) {
    links.reserve(model->links.size());
    for (const LinkModel& link : model->links) links.emplace_back(link);
    order.reserve(links.size());
  }

  // Whether a link can be asked at all: there are clouds, a pose, and geometry.
  bool can_query(std::size_t i, const Eigen::Isometry3d& X_FL, SnapshotSpan clouds) const {
    return !clouds.empty() && X_FL.matrix().allFinite() && model->links[i].usable() &&
           !model->links[i].tree.empty();
  }

  // The same with a pose for each link of this model.
  bool can_query(std::size_t i, Span<const Eigen::Isometry3d> X_FL, const std::vector<bool>& known,
                 SnapshotSpan clouds) const {
    const bool fits = X_FL.size() == links.size() && known.size() == links.size();
    return fits && known[i] && can_query(i, X_FL[i], clouds);
  }

  // Asks the links in `order`. With a deadline they take turns: those that are free are proven to
  // be, and each gets an obstacle that was measured; then all distances are known to half, and each
  // link takes no more than its share of the time that is left; last come all to the tolerance,
  // those that may be nearest first.
  // @returns false: the deadline passed first
  bool run_links(SnapshotSpan clouds, Deadline* deadline) {
    if (config.deadline > 0.0) {
      for (const std::size_t i : order) links[i].warm_start(clouds, false);
      take_turn(clouds, Goal::kFree, deadline);
    }
    for (const std::size_t i : order) {
      if (links[i].distance() < kInfinity) continue;
      links[i].warm_start(clouds, !deadline->passed_by(kFirstObstacles));
    }
    if (config.deadline > 0.0) {
      sort_links([](const LinkQuery& link) { return link.distance(); });
      take_turn(clouds, Goal::kHalf, deadline);
      sort_links([](const LinkQuery& link) { return link.proven_bound(); });
      if (deadline->passed()) return false;
    }
    bool complete = true;
    for (const std::size_t i : order) {
      complete = links[i].run(clouds, Goal::kTolerance, deadline) && complete;
    }
    return complete;
  }

  void take_turn(SnapshotSpan clouds, Goal goal, Deadline* deadline) {
    // The first turn leaves half of the time to obstacles.
    std::size_t left = order.size(), parts = goal == Goal::kFree ? 2 : 1;
    for (const std::size_t i : order) {
      Deadline share(deadline, parts * left--);
      links[i].run(clouds, goal, &share);
    }
  }

  template <class Key>
  void sort_links(const Key& key) {
    std::sort(order.begin(), order.end(),
              [&](std::size_t a, std::size_t b) { return key(links[a]) < key(links[b]); });
  }

  // Counts a link that a deadline left with wider bounds than were asked for.
  // @param unfinished_extent  [m] width of the bounds of obstacles' spheres
  void count_unfinished(const LinkProximity& result, double unfinished_extent) {
    if (result.state == LinkState::kClear) return;
    const double width =
        std::max(result.distance - result.lower_bound - result.sensor_width - config.margin,
                 unfinished_extent);
    const double asked = std::max(config.tolerance, config.relative_tolerance * result.distance);
    if (width <= asked + kBoundError) return;  // false for NaN: UNKNOWN
    ++statistics.unfinished;
    if (width > statistics.widest) statistics.widest = width;
  }

  std::shared_ptr<const RobotModel> model;
  QueryConfig config;
  std::vector<std::size_t> order;  // of the links that are asked
  std::vector<LinkQuery> links;
  SceneTracker scene;
  std::size_t last_nearest = 0;  // link that the last run_minimum() found
  QueryStatistics statistics;
};

ProximityQuery::ProximityQuery(std::shared_ptr<const RobotModel> model, const QueryConfig& config)
    : impl_(std::make_unique<Impl>(std::move(model), config)) {}
ProximityQuery::~ProximityQuery() = default;
ProximityQuery::ProximityQuery(ProximityQuery&&) noexcept = default;
ProximityQuery& ProximityQuery::operator=(ProximityQuery&&) noexcept = default;

bool ProximityQuery::run(Span<const Eigen::Isometry3d> X_FL, const std::vector<bool>& known,
                         SnapshotSpan clouds, std::vector<LinkProximity>* results) {
  const std::size_t count = impl_->links.size();
  results->resize(count);
  impl_->statistics = {};
  Deadline deadline(impl_->config.deadline);
  const SceneId scene = impl_->scene.identify(clouds);
  std::vector<std::size_t>& order = impl_->order;
  order.clear();
  for (std::size_t i = 0; i < count; ++i) {
    if (!impl_->can_query(i, X_FL, known, clouds)) {
      (*results)[i].reset();
      impl_->links[i].forget();
      continue;
    }
    order.push_back(i);
    impl_->links[i].begin(X_FL[i], clouds, scene, impl_->config, {}, &impl_->statistics, &deadline);
  }
  const bool complete = impl_->run_links(clouds, &deadline);
  for (const std::size_t i : order) {
    impl_->links[i].answer(clouds, &(*results)[i]);
    if (!complete) {
      impl_->count_unfinished((*results)[i], impl_->links[i].extent_width());
    }
  }
  return complete;
}

namespace {

// The k-th of all indices, of which one comes before the others.
std::size_t index_at(std::size_t k, std::size_t first) {
  if (k == 0) return first;
  return k <= first ? k - 1 : k;
}

// Lowers the bounds of the nearest link to what is proven of all: with the points' extents, and
// without. Where some are not known, nothing is.
void lower(double proven, double proven_points, LinkProximity* answer) {
  const double points = std::min(answer->lower_bound + answer->sensor_width, proven_points);
  answer->lower_bound = std::min(answer->lower_bound, proven);
  if (answer->sensor_width <= 0.0 || proven == -kInfinity) return;
  answer->sensor_width = std::max(points - answer->lower_bound, 0.0);
}

}  // namespace

bool ProximityQuery::run_minimum(Span<const Eigen::Isometry3d> X_FL, const std::vector<bool>& known,
                                 SnapshotSpan clouds, RobotProximity* result) {
  const std::size_t count = impl_->links.size();
  impl_->statistics = {};
  *result = RobotProximity();
  result->all_known = true;
  Deadline deadline(impl_->config.deadline);
  const SceneId scene = impl_->scene.identify(clouds);
  LinkQuery::OtherLinks nearest;
  double proven = kInfinity, proven_points = kInfinity;
  std::size_t best = count;
  bool complete = true, all_in_regions = true, best_in_range = false, may_be_inside = false;
  // The link that was nearest last time comes first: its upper bound prunes most of the others.
  const std::size_t first = impl_->last_nearest;
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t i = index_at(k, first);
    if (!impl_->can_query(i, X_FL, known, clouds)) {
      result->all_known = false;
      continue;
    }
    LinkQuery& link = impl_->links[i];
    link.begin(X_FL[i], clouds, scene, impl_->config, nearest, &impl_->statistics, &deadline);
    if (best == count) link.warm_start(clouds);
    complete = link.run(clouds, Goal::kTolerance, &deadline) && complete;
    all_in_regions = all_in_regions && link.is_inside_regions();
    may_be_inside = may_be_inside || link.may_be_inside();
    proven = std::min(proven, link.proven_bound());
    proven_points = std::min(proven_points, link.proven_points_bound());
    nearest.extents = std::min(nearest.extents, link.extent_distance());
    // A link in range may have a nearest point that is farther than another link's, by extents.
    const bool is_nearer = link.distance() < nearest.distance;
    if (best == count || (link.is_in_range() == best_in_range ? is_nearer : !best_in_range)) {
      best = i;
      best_in_range = link.is_in_range();
    }
    if (is_nearer) nearest.distance = link.distance();
  }
  if (best == count) return complete;
  impl_->links[best].answer(clouds, &result->nearest);
  LinkProximity& answer = result->nearest;
  if (answer.state == LinkState::kNear || answer.state == LinkState::kContact) {
    result->link = static_cast<std::int32_t>(best);
    lower(result->all_known ? proven : -kInfinity, proven_points, &answer);
    impl_->last_nearest = best;
  } else if (!complete || !all_in_regions || !result->all_known || may_be_inside) {
    answer.reset();
  }
  return complete;
}

bool ProximityQuery::run_link(std::size_t link, const Eigen::Isometry3d& X_FL, SnapshotSpan clouds,
                              LinkProximity* result) {
  impl_->statistics = {};
  if (link >= impl_->links.size()) {
    result->reset();
    return true;
  }
  if (!impl_->can_query(link, X_FL, clouds)) {
    result->reset();
    impl_->links[link].forget();
    return true;
  }
  Deadline deadline(impl_->config.deadline);
  impl_->links[link].begin(X_FL, clouds, impl_->scene.identify(clouds), impl_->config, {},
                           &impl_->statistics, &deadline);
  impl_->links[link].warm_start(clouds);
  const bool complete = impl_->links[link].run(clouds, Goal::kTolerance, &deadline);
  impl_->links[link].answer(clouds, result);
  return complete;
}

void ProximityQuery::set_model(std::shared_ptr<const RobotModel> model) {
  assert(same_geometry(*model, *impl_->model));
  for (std::size_t i = 0; i < impl_->links.size(); ++i) impl_->links[i].set_link(model->links[i]);
  impl_->model = std::move(model);
}

void ProximityQuery::set_config(const QueryConfig& config) { impl_->config = within_reach(config); }
const QueryConfig& ProximityQuery::config() const { return impl_->config; }
const QueryStatistics& ProximityQuery::statistics() const { return impl_->statistics; }
const RobotModel& ProximityQuery::model() const { return *impl_->model; }
std::size_t ProximityQuery::memory() const {
  std::size_t bytes = sizeof(Impl);
  for (const LinkQuery& link : impl_->links) bytes += link.memory();
  return bytes;
}

bool is_rigid(const Eigen::Isometry3d& X, double tolerance) {
  const Eigen::Matrix3d error = X.linear().transpose() * X.linear() - Eigen::Matrix3d::Identity();
  // The comparisons are false for NaN.
  return error.cwiseAbs().maxCoeff() <= tolerance && X.linear().determinant() > 0.0 &&
         X.translation().allFinite();
}

}  // namespace ist
