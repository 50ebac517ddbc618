#include <ros/console.h>

#include <algorithm>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "ros/common/memory.h"
#include "ros/model/model_loader.h"

// Background work on the model: distance fields, coarse ones of all links first, and then final
// packings of the links that need them, one link at a time.

namespace ist {

/// Contact volumes and the depth of link pairs are as good as the spheres; distances are exact with
/// any.
bool ModelLoader::needs_final_packing(const ModelState& state, std::size_t link) const {
  return config_.self_collision.enabled || config_.contacts_wanted == ContactsWanted::kAll ||
         (config_.contacts_wanted == ContactsWanted::kAuto && state.usage->was_near(link));
}

/// The link to refine next, by the order of their next steps. None where nothing is left to do.
std::optional<std::size_t> ModelLoader::link_to_refine(const ModelState& state) const {
  using LinkStep = AnytimeModel::LinkStep;
  if (!state.is_ready() || !state.anytime) return std::nullopt;
  std::optional<std::size_t> chosen;
  LinkStep first = LinkStep::kNone;
  for (std::size_t i = 0; i < state.robot->links.size(); ++i) {
    const LinkStep step = AnytimeModel::next_step(state.robot->links[i]);
    const bool is_wanted = step != LinkStep::kSpheres || needs_final_packing(state, i);
    if (!is_wanted || !(step < first)) continue;
    first = step;
    chosen = i;
  }
  return chosen;
}

/// Models that have been replaced are freed here, not in the cycle.
void ModelLoader::refine() {
  retired_.erase(std::remove_if(retired_.begin(), retired_.end(),
                                [](const auto& state) { return state.use_count() == 1; }),
                 retired_.end());
  bool is_finer = false;
  while (!stop_ && refine_once()) is_finer = true;
  if (is_finer) return_free_memory();  // packing needs some megabytes
}

/// @returns false where there is nothing to do
bool ModelLoader::refine_once() {
  const auto state = this->state();
  const auto link = link_to_refine(*state);
  if (!link) return false;
  RobotModelCallbacks callbacks;
  callbacks.cancelled = [this] { return cancelled(); };
  std::vector<std::string> warnings;
  callbacks.warning = [&](const std::string& warning) {
    ROS_WARN_STREAM(warning);
    warnings.push_back(warning);
  };
  const AnytimeModel::Ptr refined = state->anytime->advanced(*link, callbacks);
  if (refined) take_packings(*state, refined, warnings);
  return refined != nullptr;
}

/// Publishes finer packings. Where the model has changed meanwhile, it takes those that it can use.
void ModelLoader::take_packings(const ModelState& base, const AnytimeModel::Ptr& refined,
                                const std::vector<std::string>& warnings) {
  const std::lock_guard<std::mutex> change(change_mutex_);
  const auto state = this->state();
  if (!state->is_ready() || !state->anytime) return;
  auto next = std::make_shared<ModelState>(*state);
  next->anytime =
      state->anytime == base.anytime ? refined : state->anytime->with_packings_of(*refined);
  next->robot = next->anytime->robot();
  next->repulsion = std::make_shared<const Repulsion>(next->robot);
  next->warnings.insert(next->warnings.end(), warnings.begin(), warnings.end());
  const std::lock_guard<std::mutex> lock(mutex_);
  if (state_ != state) return;  // it is being loaded again
  state_ = std::move(next);
  retired_.push_back(state);
}

}  // namespace ist
