#include "internal/robot/anytime_model.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <sstream>
#include <utility>

#include "anytime_step.h"
#include "internal/geometry/cancelled.h"
#include "internal/geometry/distance_field.h"
#include "internal/geometry/solid_queries.h"
#include "ist_proximity/geometry/error.h"

namespace ist {
namespace {

void check_config(const PackingConfig& config) {
  std::ostringstream text;
  if (!std::isfinite(config.max_error) || config.max_error <= 0.0) {
    text << "packing/max_error is " << config.max_error << " m; it must be > 0";
  } else if (config.max_spheres < 1) {
    text << "packing/max_spheres is " << config.max_spheres << "; it must be at least 1";
  }
  if (!text.str().empty()) throw ModelError(text.str());
}

// A group of links is ready at each of these shares of the work on all links.
constexpr double kShares[] = {0.1, 0.3, 0.6, 1.0};

bool has_pending(const RobotModel& robot) {
  return std::any_of(robot.links.begin(), robot.links.end(), is_pending);
}

using Field = std::shared_ptr<const DistanceField>;
bool is_finer(const Field& a, const Field& b) {
  return a != nullptr && (b == nullptr || a->detail() > b->detail());
}

}  // namespace

AnytimeModel::AnytimeModel() = default;
AnytimeModel::AnytimeModel(const AnytimeModel& other) = default;
AnytimeModel::~AnytimeModel() = default;

AnytimeModel::Ptr AnytimeModel::build(std::shared_ptr<const RobotDescription> description,
                                      const RobotModelConfig& config, Stage stage,
                                      const RobotModelCallbacks& callbacks,
                                      const Partial& partial) {
  check_config(config.packing);
  const auto empty = std::make_shared<AnytimeModel>();
  empty->description_ = std::move(description);
  empty->config_ = config;
  Step first(empty, callbacks);
  first.choose_links();
  first.warn_of_visual_fallback();
  Ptr made = empty;
  double done = 0.0;
  for (const double share : kShares) {
    if (!partial && share < 1.0) continue;
    Step step(std::make_shared<AnytimeModel>(*made), callbacks);
    if (!step.begin_links(share)) continue;
    step.set_progress(std::exchange(done, share), share);
    if (!step.make_solids(made->robot_.get(), nullptr)) return nullptr;
    step.add_unknown_shapes(stage);
    if (!step.pack(config.threads)) return nullptr;
    made = step.finish(made->robot_.get(), nullptr);
    if (made == nullptr) return nullptr;
    if (!has_pending(*made->robot_)) break;
    partial(made);
  }
  return made;
}

AnytimeModel::Ptr AnytimeModel::refined(std::size_t link,
                                        const RobotModelCallbacks& callbacks) const {
  Step step(std::make_shared<AnytimeModel>(*this), callbacks);
  step.add_shapes_to_refine(link);
  return step.pack(1) ? step.finish(robot_.get(), nullptr) : nullptr;
}

AnytimeModel::Ptr AnytimeModel::with_packings_of(const AnytimeModel& other) const {
  const auto model = std::make_shared<AnytimeModel>(*this);
  Step step(model, {});
  for (auto& [key, known] : model->shapes_) {
    const auto found = other.shapes_.find(key);
    if (found == other.shapes_.end() || known->is_final || !found->second->error.empty()) continue;
    const ShapePacking& theirs = *found->second;
    if (!theirs.is_final &&
        theirs.packing.certificate.max_gap >= known->packing.certificate.max_gap) {
      continue;
    }
    known = found->second;
    step.touch(key);
  }
  if (step.finish(robot_.get(), nullptr) == nullptr) return nullptr;
  const auto robot = std::make_shared<RobotModel>(*model->robot_);
  for (LinkModel& link : robot->links) {
    for (const LinkModel& theirs : other.robot_->links) {
      if (is_finer(theirs.field, link.field) && is_same_solid(link.solid, theirs.solid)) {
        link.field = theirs.field;
      }
    }
  }
  model->robot_ = robot;
  return model;
}

AnytimeModel::Ptr AnytimeModel::with_field(std::size_t link,
                                           const RobotModelCallbacks& callbacks) const {
  const auto model = std::make_shared<AnytimeModel>(*this);
  const auto robot = std::make_shared<RobotModel>(*robot_);
  try {
    const Solid& solid = robot->links[link].solid;
    const auto detail = robot->links[link].field == nullptr ? DistanceField::Detail::kCoarse
                                                            : DistanceField::Detail::kFine;
    const auto field =
        Step(model, callbacks).field_of(links_[link].description->geometry, solid, detail);
    for (LinkModel& other : robot->links) {
      if (is_same_solid(other.solid, solid)) other.field = field;
    }
  } catch (const Cancelled&) {
    return nullptr;
  }
  model->robot_ = robot;
  return model;
}

AnytimeModel::LinkStep AnytimeModel::next_step(const LinkModel& link) {
  if (!link.usable()) return LinkStep::kNone;
  if (link.field == nullptr) return LinkStep::kCoarseField;
  if (link.field->detail() == DistanceField::Detail::kCoarse) return LinkStep::kFineField;
  return link.is_final ? LinkStep::kNone : LinkStep::kSpheres;
}

AnytimeModel::Ptr AnytimeModel::advanced(std::size_t link,
                                         const RobotModelCallbacks& callbacks) const {
  const LinkStep step = next_step(robot_->links[link]);
  assert(step != LinkStep::kNone);
  return step == LinkStep::kSpheres ? refined(link, callbacks) : with_field(link, callbacks);
}

AnytimeModel::Ptr AnytimeModel::with_link(std::shared_ptr<const RobotDescription> description,
                                          const std::string& link, const RobotModelConfig& config,
                                          const RobotModelCallbacks& callbacks) const {
  const auto model = std::make_shared<AnytimeModel>(*this);
  model->description_ = std::move(description);
  model->config_ = config;
  Step step(model, callbacks);
  step.choose_links();
  if (!step.make_solids(robot_.get(), &link)) return nullptr;
  step.forget_unused_shapes();
  step.add_unknown_shapes(Stage::kFinal);
  return step.pack(config.threads) ? step.finish(robot_.get(), &link) : nullptr;
}

}  // namespace ist
