#include "anytime_step.h"

#include <algorithm>
#include <cassert>
#include <cstdio>
#include <iterator>
#include <numeric>

#include "field_cache.h"
#include "first_packing.h"
#include "internal/bvh/build_id.h"
#include "internal/geometry/cancelled.h"
#include "internal/geometry/distance_field.h"
#include "internal/geometry/solid_queries.h"
#include "internal/packing/packing_cache.h"
#include "internal/robot/link_packing.h"
#include "internal/robot/threads.h"

namespace ist {
namespace {

std::string millimetres(double metres) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.2f mm", 1e3 * metres);
  return text;
}

const LinkModel* find_link(const RobotModel* robot, const std::string& name) {
  if (robot == nullptr) return nullptr;
  const auto found = std::find_if(robot->links.begin(), robot->links.end(),
                                  [&](const LinkModel& link) { return link.name == name; });
  return found != robot->links.end() ? &*found : nullptr;
}

}  // namespace

void AnytimeModel::Step::choose_links() {
  model_->links_.clear();
  for (MonitoredLink& chosen : select_links(*model_->description_, model_->config_.links)) {
    Link link;
    static_cast<MonitoredLink&>(link) = std::move(chosen);
    if (link.error.empty()) {
      const LinkGeometry& geometry = link.description->geometry;
      link.configs = link_configs(geometry, link.description->attached, model_->config_.packing);
      for (std::size_t e = 0; e < geometry.size(); ++e) {
        link.keys.push_back(packing_key(geometry[e].shape, link.configs[e]));
      }
    }
    model_->links_.push_back(std::move(link));
  }
}

bool AnytimeModel::Step::begin_links(double share) {
  std::vector<Link>& links = model_->links_;
  std::vector<double> work(links.size(), 0.0);
  std::vector<std::size_t> order(links.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  for (std::size_t i = 0; i < links.size(); ++i) {
    if (!links[i].error.empty()) continue;
    for (const GeometryElement& element : links[i].description->geometry) {
      work[i] += packing_work(element.shape);
    }
  }
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return work[a] < work[b]; });
  const double all = std::accumulate(work.begin(), work.end(), 0.0);
  const bool is_first = model_->robot_ == nullptr;
  double sum = 0.0;
  bool any = share >= 1.0;
  for (const std::size_t i : order) {
    sum += work[i];
    const bool was_pending = is_first || links[i].is_pending;
    links[i].is_pending = sum > share * all && share < 1.0;
    any = any || (was_pending && !links[i].is_pending);
  }
  return any;
}

// Packing reads their hierarchies, so they are made first. False when cancelled.
// @param before   supplies the solids that are known; may be null
// @param changed  the link whose geometry may differ from `before`
bool AnytimeModel::Step::make_solids(const RobotModel* before, const std::string* changed) {
  const auto one = [&](std::size_t i) {
    Link& link = model_->links_[i];
    if (link.is_pending || !link.solid.empty()) return;
    const bool may_be_known = changed == nullptr || link.name != *changed;
    link.solid = solid_of(link, may_be_known ? find_link(before, link.name) : nullptr);
  };
  try {
    for_each_in_parallel(model_->links_.size(), model_->config_.threads, one);
  } catch (const Cancelled&) {
    return false;
  }
  return true;
}

Solid AnytimeModel::Step::solid_of(const Link& link, const LinkModel* before) const {
  if (!link.error.empty()) return {};
  if (before != nullptr && !is_pending(*before)) return before->solid;
  return make_solid(link.description->geometry, [this] { return is_cancelled(); });
}

// Packings of objects that are detached again are not kept.
void AnytimeModel::Step::forget_unused_shapes() {
  std::set<std::string> used;
  for (const Link& link : model_->links_) used.insert(link.keys.begin(), link.keys.end());
  for (auto shape = model_->shapes_.begin(); shape != model_->shapes_.end();) {
    shape = used.count(shape->first) > 0 ? std::next(shape) : model_->shapes_.erase(shape);
  }
}

void AnytimeModel::Step::add_job(const Link& link, std::size_t element, const PackingConfig& now) {
  PackingJob job;
  job.key = link.keys[element];
  if (!touched_.insert(job.key).second) return;
  job.shape = &link.description->geometry[element].shape;
  if (const auto surface = surface_of(link.solid, element)) job.surface.emplace(*surface);
  job.config = link.configs[element];
  job.now = now;
  job.link = static_cast<std::size_t>(&link - model_->links_.data());
  job.work = packing_work(*job.shape);
  jobs_.push_back(std::move(job));
}

// One job for each distinct shape and configuration: two equal fingers are packed once.
void AnytimeModel::Step::add_unknown_shapes(Stage stage) {
  for (const Link& link : model_->links_) {
    for (std::size_t e = 0; e < link.keys.size() && !link.is_pending; ++e) {
      if (model_->shapes_.count(link.keys[e]) > 0) continue;
      const Shape& shape = link.description->geometry[e].shape;
      add_job(link, e,
              stage == Stage::kFirst ? first_packing(shape, link.configs[e]) : link.configs[e]);
    }
  }
}

void AnytimeModel::Step::add_shapes_to_refine(std::size_t index) {
  const Link& link = model_->links_[index];
  for (std::size_t e = 0; e < link.keys.size(); ++e) {
    if (!model_->shapes_.at(link.keys[e])->is_final) add_job(link, e, link.configs[e]);
  }
  for (PackingJob& job : jobs_) job.look_in_cache = false;  // the first one has looked
}

// False when cancelled.
bool AnytimeModel::Step::pack(int threads) {
  const PackingCache cache(model_->config_.cache_directory);
  const auto report = [&](const PackingJob& job, double fraction) {
    if (is_cancelled()) return false;
    if (callbacks_.progress) {
      callbacks_.progress({model_->links_[job.link].name, job.link, model_->links_.size(),
                           progress_begin_ + (progress_end_ - progress_begin_) * fraction});
    }
    return true;
  };
  if (is_cancelled() || !PackingJobs(&jobs_, cache, report).run(threads)) return false;
  for (PackingJob& job : jobs_) take(&job);
  return true;
}

void AnytimeModel::Step::take(PackingJob* job) {
  auto shape = std::make_shared<ShapePacking>();
  std::shared_ptr<const ShapePacking>& known = model_->shapes_[job->key];
  if (known && !job->error.empty()) {
    *shape = *known;
    shape->is_final = true;
    if (callbacks_.warning) {
      callbacks_.warning("link '" + model_->links_[job->link].name +
                         "' cannot be packed more finely: " + job->error);
    }
  } else {
    shape->packing = std::move(job->packing);
    shape->is_final = job->is_final || !job->error.empty();
    shape->from_cache = job->from_cache;
    shape->time = job->time + (known ? known->time : 0.0);
    shape->error = job->error;
  }
  known = std::move(shape);
}

bool AnytimeModel::Step::is_touched(const Link& link) const {
  return std::any_of(link.keys.begin(), link.keys.end(),
                     [&](const std::string& key) { return touched_.count(key) > 0; });
}

LinkModel AnytimeModel::Step::assemble(const Link& link, const LinkModel* before,
                                       bool same_geometry) {
  LinkModel model;
  model.name = link.name;
  model.error = link.error;
  if (link.is_pending && model.error.empty()) model.error = kPending;
  if (!model.usable()) return model;
  const LinkGeometry& geometry = link.description->geometry;
  std::vector<const Packing*> packings;
  model.from_cache = true;
  for (std::size_t e = 0; e < geometry.size(); ++e) {
    const ShapePacking& shape = *model_->shapes_.at(link.keys[e]);
    if (!shape.error.empty()) {
      model.error = "link '" + link.name + "', element " + std::to_string(e + 1) + " (" +
                    geometry[e].source + ") cannot be packed: " + shape.error;
      model.from_cache = false;
      return model;
    }
    packings.push_back(&shape.packing);
    model.from_cache = model.from_cache && shape.from_cache;
    model.is_final = model.is_final && shape.is_final;
    model.packing_time += shape.time;
  }
  const auto cancelled = [this] { return is_cancelled(); };
  model.packing = combine(geometry, packings);
  model.tree = InnerSphereTree(model.packing);
  model.packing_id = next_build_id();
  throw_if(cancelled);
  assert(!link.solid.empty());  // a link without its solid would be clear of everything
  model.solid = link.solid;
  if (before != nullptr && same_geometry) model.field = before->field;
  if (model.field == nullptr && model_->config_.distance_fields) {
    model.field = field_of(geometry, model.solid, DistanceField::Detail::kFine);
  }
  return model;
}

std::shared_ptr<const DistanceField> AnytimeModel::Step::field_of(const LinkGeometry& geometry,
                                                                  const Solid& solid,
                                                                  DistanceField::Detail detail) {
  const std::string key = field_key(geometry);
  Field* made = nullptr;
  {
    const std::lock_guard<std::mutex> lock(fields_mutex_);
    made = &fields_[key];
  }
  std::call_once(made->is_made, [&] {
    const FieldCache cache(model_->config_.cache_directory);
    std::string warning;
    made->field = cache.load(key, solid, &warning);
    if (!warning.empty()) warn(warning + "; they are measured again");
    if (made->field) return;
    made->field =
        std::make_shared<const DistanceField>(solid, detail, [this] { return is_cancelled(); });
    warning.clear();
    if (detail == DistanceField::Detail::kFine) cache.store(key, *made->field, &warning);
    if (!warning.empty()) warn(warning);
  });
  return made->field;
}

// Links are made by several threads.
void AnytimeModel::Step::warn(const std::string& warning) const {
  const std::lock_guard<std::mutex> lock(cancel_mutex_);
  if (callbacks_.warning) callbacks_.warning(warning);
}

AnytimeModel::Ptr AnytimeModel::Step::finish(const RobotModel* before, const std::string* changed) {
  const auto robot = std::make_shared<RobotModel>();
  robot->name = model_->description_->name;
  robot->root_link = model_->description_->root_link;
  const bool is_partial =
      before != nullptr && std::any_of(before->links.begin(), before->links.end(), is_pending);
  const bool is_same_robot = before != nullptr && changed == nullptr && !is_partial;
  robot->geometry_id = is_same_robot ? before->geometry_id : next_build_id();
  robot->links.resize(model_->links_.size());
  const auto one = [&](std::size_t i) {
    const Link& link = model_->links_[i];
    const LinkModel* same = find_link(before, link.name);
    const bool same_geometry = changed == nullptr || link.name != *changed;
    robot->links[i] = same != nullptr && same_geometry && !is_touched(link) && !is_pending(*same)
                          ? *same
                          : assemble(link, same, same_geometry);
  };
  try {
    const bool is_one = before != nullptr && !is_partial;
    for_each_in_parallel(robot->links.size(), is_one ? 1 : model_->config_.threads, one);
  } catch (const Cancelled&) {
    return nullptr;
  }
  warn(*robot);
  model_->robot_ = robot;
  return model_;
}

void AnytimeModel::Step::warn_of_visual_fallback() const {
  std::string names;
  std::size_t count = 0;
  for (const Link& link : model_->links_) {
    if (!link.error.empty() || !link.description->used_visual_fallback) continue;
    names += (count++ > 0 ? ", '" : "'") + link.name + "'";
  }
  if (count == 0 || !callbacks_.warning) return;
  const bool is_one = count == 1;
  callbacks_.warning((is_one ? "link " : "links ") + names + (is_one ? " has" : " have") +
                     " no collision geometry in the URDF; the visual one is used instead");
}

void AnytimeModel::Step::warn(const RobotModel& robot) const {
  if (!callbacks_.warning) return;
  for (const PackingJob& job : jobs_) {
    if (!job.load_warning.empty()) {
      callbacks_.warning(job.load_warning + "; the link is packed again");
    }
  }
  // A full or read-only disk says the same for every shape.
  const auto refused = std::find_if(
      jobs_.begin(), jobs_.end(), [](const PackingJob& job) { return !job.store_warning.empty(); });
  if (refused != jobs_.end()) callbacks_.warning(refused->store_warning);
  for (std::size_t l = 0; l < model_->links_.size(); ++l) {
    const LinkModel& link = robot.links[l];
    if (!link.usable() || !is_touched(model_->links_[l])) continue;
    if (link.is_final && !link.packing.certificate.reached) {
      const PackingConfig& wanted = model_->config_.packing;
      callbacks_.warning(
          "link '" + link.name + "' is packed with " + std::to_string(link.packing.spheres.size()) +
          " spheres to an error of " + millimetres(link.packing.certificate.max_gap) +
          " instead of " + millimetres(wanted.max_error) + ": packing/max_spheres (" +
          std::to_string(wanted.max_spheres) + ") was reached first; raise it, or max_error");
    }
  }
}

}  // namespace ist
