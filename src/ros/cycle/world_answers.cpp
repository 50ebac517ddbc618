#include "ros/cycle/world_answers.h"

#include <algorithm>

namespace ist {
namespace {

bool is_near(const LinkProximity& answer) {
  return answer.state == LinkState::kNear || answer.state == LinkState::kContact;
}

}  // namespace

void WorldAnswers::note_motion(const CloudSelection& selection, double time) {
  const Span<const PosedWorld* const> worlds = selection.worlds();
  motions_.resize(worlds.size());
  for (std::size_t w = 0; w < worlds.size(); ++w) {
    Motion& motion = motions_[w];
    const PosedWorld& world = *worlds[w];
    const bool is_other = motion.world != world.world;
    motion.place.note(world.X_FB, time, is_other && motion.world);
    if (is_other) ++key_;
    motion.world = world.world;
  }
}

void WorldAnswers::run(Span<const Eigen::Isometry3d> X_FL, const std::vector<bool>& known,
                       const CloudSelection& selection, QueryConfig query,
                       double influence_distance, double time, TimePoint end, LateFrames* late,
                       DeadlineCost* cost) {
  is_nearest_.assign(X_FL.size(), false);
  any_ = !selection.worlds().empty();
  time_ = time;
  if (!any_) return;
  if (!query_ || query_->robot() != selection.surfaces()) {
    query_ = std::make_unique<WorldQuery>(selection.surfaces(), query);
  }
  note_motion(selection, time);
  const double max_distance = query.max_distance;
  query.max_distance = late->range(max_distance);
  query_->set_config(query);
  query_->set_influence_distance(influence_distance);
  query_->run(X_FL, known, selection.worlds(), end, &answers_);
  late->lower(max_distance, &answers_);
  cost->unfinished += query_->statistics().unfinished;
  cost->widest = std::max(cost->widest, query_->statistics().widest);
}

void WorldAnswers::combine(SnapshotSpan clouds, std::vector<LinkProximity>* results) {
  if (!any_ || answers_.size() != results->size()) return;
  for (std::size_t i = 0; i < results->size(); ++i) {
    LinkProximity& cloud = (*results)[i];
    const LinkProximity& world = answers_[i];
    if (clouds.empty() || world.state == LinkState::kUnknown) {
      cloud = world;
      is_nearest_[i] = is_near(world);
      continue;
    }
    if (cloud.state == LinkState::kUnknown) continue;
    const double lower_bound = std::min(cloud.lower_bound, world.lower_bound);
    if (is_near(world) && world.distance < cloud.distance) {
      cloud = world;
      is_nearest_[i] = true;
    }
    cloud.lower_bound = lower_bound;
  }
}

ClosingSpeed::Nearest WorldAnswers::nearest(const LinkProximity& answer, int source) const {
  if (source < 0) return {};
  const Motion& motion = motions_[static_cast<std::size_t>(answer.source)];
  return {source, motion.place.key(), time_, motion.place.stands_still(time_)};
}

}  // namespace ist
