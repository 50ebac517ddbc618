#include "ist_proximity/proximity/world_query.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "internal/geometry/cancelled.h"
#include "internal/proximity/deadline.h"
#include "proximity/object_search.h"
#include "proximity/within_reach.h"

namespace ist {
namespace {

// Pairs of boxes that a link looks at before the clock is read: some tens of microseconds.
constexpr int kObjectSlice = 256;

bool is_placed(const PosedWorld& posed) {
  if (!posed.world) return true;
  return posed.X_FB.size() == posed.world->frames().size() &&
         std::all_of(posed.X_FB.begin(), posed.X_FB.end(),
                     [](const Eigen::Isometry3d& X) { return X.matrix().allFinite(); });
}

}  // namespace

std::shared_ptr<const RobotSurfaces> make_robot_surfaces(std::shared_ptr<const RobotModel> model,
                                                         const std::function<bool()>& cancelled) {
  auto robot = std::make_shared<RobotSurfaces>();
  try {
    for (const LinkModel& link : model->links) {
      robot->surfaces.emplace_back();
      if (!link.usable() || link.tree.empty()) continue;
      robot->surfaces.back() = LinkSurface::of(link, cancelled);
    }
  } catch (const Cancelled&) {
    return nullptr;
  }
  robot->model = std::move(model);
  return robot;
}

struct WorldQuery::Impl {
  // A link that is not finished.
  struct Waiting {
    double bound;
    std::size_t link;
    bool operator<(const Waiting& other) const { return bound > other.bound; }  // least on top
  };

  void prepare_searches();
  void finish_by(Deadline* deadline);
  void count_unfinished(const LinkProximity& result);

  std::shared_ptr<const RobotSurfaces> robot;
  QueryConfig config;
  std::vector<double> link_margins;
  double influence_distance = 0.0;
  WorldQueryStatistics statistics;
  PosedObjects objects;
  std::vector<ObjectSearch> searches;  // by link
  std::vector<Waiting> queue;          // a heap
};

WorldQuery::WorldQuery(std::shared_ptr<const RobotSurfaces> robot, const QueryConfig& config)
    : impl_(std::make_unique<Impl>()) {
  impl_->robot = std::move(robot);
  set_config(config);
  const std::size_t links = impl_->robot->model->links.size();
  impl_->searches.reserve(links);
  for (std::size_t i = 0; i < links; ++i) impl_->searches.emplace_back(*impl_->robot, i);
  impl_->queue.reserve(links);
}
WorldQuery::~WorldQuery() = default;
WorldQuery::WorldQuery(WorldQuery&&) noexcept = default;
WorldQuery& WorldQuery::operator=(WorldQuery&&) noexcept = default;

void WorldQuery::set_config(const QueryConfig& config) { impl_->config = within_reach(config); }
void WorldQuery::set_link_margins(std::vector<double> margins) {
  impl_->link_margins = std::move(margins);
}
void WorldQuery::set_influence_distance(double distance) { impl_->influence_distance = distance; }
const std::shared_ptr<const RobotSurfaces>& WorldQuery::robot() const { return impl_->robot; }
const WorldQueryStatistics& WorldQuery::statistics() const { return impl_->statistics; }

Span<const NearObject> WorldQuery::near_objects(std::size_t link) const {
  if (link >= impl_->searches.size()) return {};
  const std::vector<NearObject>& near = impl_->searches[link].near();
  return {near.data(), near.size()};
}

bool WorldQuery::is_finished(std::size_t link) const {
  return link < impl_->searches.size() && impl_->searches[link].is_finished();
}

// Memory for the searches of all links.
void WorldQuery::Impl::prepare_searches() {
  const WorldShape* open = nullptr;
  for (const PosedObject& posed : objects.objects()) {
    const WorldShape& shape = *posed.object->shape;
    if (!shape.surface.opening_cells.empty()) open = &shape;
  }
  for (ObjectSearch& search : searches) search.prepare(objects.objects().size(), open);
}

// The link with the least bound goes on, until all are finished or the time is over.
void WorldQuery::Impl::finish_by(Deadline* deadline) {
  std::make_heap(queue.begin(), queue.end());
  while (!queue.empty() && !deadline->passed()) {
    std::pop_heap(queue.begin(), queue.end());
    const std::size_t link = queue.back().link;
    queue.pop_back();
    if (searches[link].advance(kObjectSlice)) continue;
    queue.push_back({searches[link].lower_bound(), link});
    std::push_heap(queue.begin(), queue.end());
  }
}

void WorldQuery::Impl::count_unfinished(const LinkProximity& result) {
  ++statistics.unfinished;
  if (result.state == LinkState::kUnknown) return;
  statistics.widest =
      std::max(statistics.widest, result.distance - result.lower_bound - config.margin);
}

bool WorldQuery::run(Span<const Eigen::Isometry3d> X_FL, const std::vector<bool>& known,
                     Span<const PosedWorld* const> worlds, TimePoint end,
                     std::vector<LinkProximity>* results) {
  Impl& impl = *impl_;
  const std::size_t count = impl.searches.size();
  impl.statistics = {};
  results->resize(count);
  for (LinkProximity& result : *results) result.reset();
  for (ObjectSearch& search : impl.searches) search.begin_unknown();
  if (X_FL.size() != count || known.size() != count ||
      !std::all_of(worlds.begin(), worlds.end(),
                   [](const PosedWorld* world) { return is_placed(*world); })) {
    return true;
  }
  if (impl.objects.take(worlds)) impl.prepare_searches();
  const bool is_limited = end != TimePoint::max();
  Deadline deadline(end);
  impl.queue.clear();
  for (std::size_t i = 0; i < count; ++i) {
    if (!known[i]) continue;
    const ObjectQuestion question{impl.config,
                                  i < impl.link_margins.size() ? impl.link_margins[i] : 0.0,
                                  impl.influence_distance};
    ObjectSearch& search = impl.searches[i];
    search.begin(X_FL[i], &impl.objects, question, &impl.statistics);
    if (search.is_finished()) continue;
    if (is_limited) {
      impl.queue.push_back({search.lower_bound(), i});
    } else {
      search.advance(std::numeric_limits<int>::max());
    }
  }
  if (is_limited) impl.finish_by(&deadline);
  for (std::size_t i = 0; i < count; ++i) {
    impl.searches[i].report(&(*results)[i]);
    if (!impl.searches[i].is_finished()) impl.count_unfinished((*results)[i]);
  }
  impl.statistics.objects_placed = impl.objects.placements();
  return impl.statistics.unfinished == 0;
}

}  // namespace ist
