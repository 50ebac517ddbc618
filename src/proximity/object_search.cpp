#include "proximity/object_search.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "internal/geometry/numbers.h"

namespace ist {
namespace {

// [m] Link and objects may move by this much until the list of objects is made anew.
constexpr double kListSlack = 0.1;
// The rounding of a box's distance, as a share of all coordinates involved.
constexpr double kBoxRounding = 1e-14;
// [m] In contact, other objects matter that are in contact too.
constexpr double kTouch = 1e-6;

// [m] The distance of a point to a box about the origin.
double distance_to_box(const Eigen::Vector3d& p, const Eigen::Vector3d& half) {
  return (p.cwiseAbs() - half).cwiseMax(0.0).norm();
}

}  // namespace

ObjectSearch::ObjectSearch(const RobotSurfaces& robot, std::size_t link)
    : model_(robot.model->links[link]), surface_(robot.surfaces[link].get()) {
  if (surface_ == nullptr) return;
  const Eigen::AlignedBox3d& box = surface_->box;
  center_L_ = box.center();
  half_L_ = 0.5 * box.sizes();
  radius_ = half_L_.norm();
  extent_ = center_L_.norm() + radius_;
}

void ObjectSearch::prepare(std::size_t objects, const WorldShape* open) {
  if (surface_ == nullptr) return;
  list_.reserve(objects);
  candidates_.reserve(objects);
  const std::size_t count = std::min(objects, kSlots);
  near_.reserve(count);
  const bool renew = open != nullptr && !slots_are_open_;
  slots_are_open_ = slots_are_open_ || open != nullptr;
  if (slots_.size() >= count && !renew) return;
  slots_.resize(std::max(count, slots_.size()));
  for (Slot& slot : slots_) {  // the pair stands for its memory alone
    slot.id = 0;
    if (open != nullptr) {
      slot.query.emplace(model_, open->link, *surface_, open->surface);
    } else {
      slot.query.emplace(model_, model_, *surface_, *surface_);
    }
  }
}

double ObjectSearch::margin_of(const PosedObject& object) const {
  return question_.config.margin + question_.link_margin + object.object->margin;
}

// [m] What is left of a lower bound of the distance to objects; -inf where that is not positive.
template <class Posed>
double ObjectSearch::less_errors(double bound, const Posed& posed, double drift) const {
  const double scale = center_F_.norm() + posed.center_F.norm() + radius_ + posed.radius;
  bound -= 4.0 * kBoxRounding * scale;
  const double proven = bound - pose_error(X_FL_.drift + drift, extent_ + posed.extent, bound);
  return proven > 0.0 ? proven : -kInfinity;
}

// [m] A lower bound of the distance of the boxes; -inf where they may overlap.
double ObjectSearch::box_bound(const PosedObject& object) const {
  const Eigen::Vector3d p_F = center_F_ - object.center_F;
  const double to_object =
      distance_to_box(object.X_FO.X.linear().transpose() * p_F, object.half) - radius_;
  const double to_link =
      distance_to_box(X_FL_.X.linear().transpose() * p_F, half_L_) - object.radius;
  return less_errors(std::max(to_object, to_link), object, object.X_FO.drift);
}

void ObjectSearch::begin_unknown() {
  is_known_ = false;
  is_finished_ = true;
  current_ = nullptr;
  candidates_.clear();
  near_.clear();
}

void ObjectSearch::begin(const Eigen::Isometry3d& X_FL, PosedObjects* objects,
                         const ObjectQuestion& question, WorldQueryStatistics* statistics) {
  begin_unknown();
  if (surface_ == nullptr || !X_FL.matrix().allFinite()) return;
  objects_ = objects;
  question_ = question;
  statistics_ = statistics;
  X_FL_ = nearest_rigid(X_FL);
  center_F_ = X_FL_.X * center_L_;
  ++queries_;
  is_known_ = true;
  is_finished_ = false;
  proven_ = distance_ = kInfinity;
  list_objects();
  collect_candidates();
  if (candidates_.empty()) {
    is_finished_ = true;
    return;
  }
  // The nearest object of the last time is the first one, as it gives the best upper bound.
  const auto first = std::find_if(candidates_.begin(), candidates_.end(), [&](const Candidate& c) {
    return objects->objects()[c.object].object->id == nearest_id_;
  });
  std::swap(first != candidates_.end() ? *first
                                       : *std::max_element(candidates_.begin(), candidates_.end()),
            candidates_.back());
  const Candidate candidate = candidates_.back();
  candidates_.pop_back();
  std::make_heap(candidates_.begin(), candidates_.end());
  activate(candidate);
}

// Objects that are not in the list are farther than the range until the slack is used up.
void ObjectSearch::list_objects() {
  const double range =
      question_.config.max_distance + question_.config.margin + question_.link_margin;
  if (generation_of_list_ == objects_->generation() && range <= range_of_list_) {
    const double moved = surface_->displacement.between(X_FL_of_list_, X_FL_.X) +
                         (objects_->path() - path_of_list_) * (1.0 + 1e-12);
    if (moved < range_of_list_ + kListSlack - range) return;
  }
  ++statistics_->scans;
  list_.clear();
  for (ObjectGroup& group : objects_->groups()) {
    const double apart = (center_F_ - group.center_F).norm() - radius_ - group.radius;
    const double proven = less_errors(apart, group, group.drift) - group.margin;
    if (proven >= range + kListSlack) continue;
    objects_->place(&group);
    statistics_->objects_bounded += group.last - group.first;
    for (std::size_t i = group.first; i < group.last; ++i) {
      const PosedObject& object = objects_->objects()[i];
      if (box_bound(object) - object.object->margin >= range + kListSlack) continue;
      const std::vector<std::string>& allowed = object.object->allowed_links;
      if (std::find(allowed.begin(), allowed.end(), model_.name) != allowed.end()) continue;
      list_.push_back(static_cast<std::uint32_t>(i));
    }
  }
  X_FL_of_list_ = X_FL_.X;
  path_of_list_ = objects_->path();
  range_of_list_ = range;
  generation_of_list_ = objects_->generation();
}

void ObjectSearch::collect_candidates() {
  candidates_.clear();
  statistics_->objects_bounded += list_.size();
  for (const std::uint32_t i : list_) {
    const PosedObject& object = objects_->objects()[i];
    const double bound = box_bound(object) - margin_of(object);
    if (bound < question_.config.max_distance) candidates_.push_back({bound, i});
  }
}

// [m] Objects whose bound is not below this change nothing.
double ObjectSearch::stop_bound() const {
  const QueryConfig& config = question_.config;
  double nearest = config.max_distance;
  if (distance_ < kInfinity) {
    const double tolerance =
        std::max(config.tolerance, config.relative_tolerance * std::abs(distance_));
    nearest = std::min(nearest, distance_ - tolerance);
  }
  return std::max(nearest, std::min(question_.influence_distance, config.max_distance));
}

ObjectSearch::Slot* ObjectSearch::slot_of(const PosedObject& object) {
  Slot* oldest = &slots_.front();
  for (Slot& slot : slots_) {
    if (slot.id == object.object->id) return &slot;
    if (slot.used < oldest->used) oldest = &slot;
  }
  const WorldShape& shape = *object.object->shape;
  LinkPairQuery fresh(model_, shape.link, *surface_, shape.surface, &*oldest->query);
  oldest->query.emplace(std::move(fresh));
  oldest->shape = object.object->shape;
  oldest->id = object.object->id;
  return oldest;
}

void ObjectSearch::activate(const Candidate& candidate) {
  const PosedObject& object = objects_->objects()[candidate.object];
  const double margin = margin_of(object);
  // An object that is farther than the nearest one need not be measured.
  const double range = std::max({distance_, question_.influence_distance, kTouch});
  QueryConfig config = question_.config;
  config.margin = margin;
  // The margin is not added to max_distance and taken off again: what rounding leaves of it then
  // may be less, and an object that is clear would be neither clear nor near.
  config.max_distance = current_range_ = std::min(range - margin, config.max_distance);
  current_candidate_ = candidate;
  current_ = slot_of(object);
  current_->used = queries_;
  current_->query->move_to(X_FL_, object.X_FO, config);
  ++statistics_->pairs_searched;
}

bool ObjectSearch::advance(int steps) {
  while (!is_finished_) {
    if (current_ == nullptr) {
      if (candidates_.empty() || candidates_.front().bound >= stop_bound()) {
        is_finished_ = true;
        break;
      }
      std::pop_heap(candidates_.begin(), candidates_.end());
      const Candidate candidate = candidates_.back();
      candidates_.pop_back();
      activate(candidate);
    }
    const int before = steps;
    const bool is_measured = current_->query->advance(&steps);
    statistics_->steps += static_cast<std::uint64_t>(before - steps);
    if (!is_measured) return false;
    take_result();
  }
  return true;
}

void ObjectSearch::take_result() {
  PairProximity found;
  current_->query->report(&found);
  current_ = nullptr;
  if (found.state == LinkState::kClear) {
    proven_ = std::min(proven_, current_range_);
    return;
  }
  // A search that ends where no two points were found proves nothing.
  proven_ = std::min(proven_, std::max(found.lower_bound, current_candidate_.bound));
  take_distance(found);
}

void ObjectSearch::take_distance(const PairProximity& found) {
  if (found.state != LinkState::kNear && found.state != LinkState::kContact) return;
  const PosedObject& object = objects_->objects()[current_candidate_.object];
  const LinkProximity answer = answer_of(found, object);
  if (near_.size() < near_.capacity()) near_.push_back({object.world, object.index, answer});
  if (!(found.distance < distance_)) return;
  distance_ = found.distance;
  nearest_ = answer;
  nearest_id_ = object.object->id;
}

LinkProximity ObjectSearch::answer_of(const PairProximity& found, const PosedObject& object) const {
  LinkProximity answer;
  answer.state = found.state;
  answer.distance = found.distance;
  answer.lower_bound = std::min(found.lower_bound, found.distance - question_.config.margin);
  answer.p_FCl = found.p_FCa;
  answer.p_LCl = X_FL_.X.inverse() * found.p_FCa;
  answer.p_FCo = found.p_FCb;
  answer.direction = found.direction;
  answer.source = static_cast<std::int32_t>(object.world);
  answer.point = object.index;
  return answer;
}

double ObjectSearch::lower_bound() const {
  if (!is_known_) return -kInfinity;
  double bound = std::min(proven_, question_.config.max_distance);
  if (!candidates_.empty()) bound = std::min(bound, candidates_.front().bound);
  if (current_ != nullptr) {
    PairProximity found;
    current_->query->report(&found);
    const double proven = found.state == LinkState::kClear ? current_range_ : found.lower_bound;
    bound = std::min(bound, std::max(proven, current_candidate_.bound));
  }
  return bound;
}

void ObjectSearch::report(LinkProximity* result) {
  if (current_ != nullptr) take_result();  // the deadline came before it was measured
  result->reset();
  if (!is_known_) return;
  const double bound = lower_bound();
  if (bound >= question_.config.max_distance) {
    result->state = LinkState::kClear;
    result->distance = kInfinity;
    result->lower_bound = question_.config.max_distance;
    return;
  }
  if (!(distance_ < kInfinity) || bound == -kInfinity) return;
  *result = nearest_;
  result->lower_bound = std::min(bound, distance_ - question_.config.margin);
}

}  // namespace ist
