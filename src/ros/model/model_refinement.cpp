#include <ros/console.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "ros/common/exceptions.h"
#include "ros/common/memory.h"
#include "ros/common/thread_name.h"
#include "ros/model/model_loader.h"

// Background work on the model: distance fields, coarse ones of all links first, and finer spheres
// for the links that need them, one link at a time.

namespace ist {
namespace {

constexpr std::chrono::milliseconds kPollNeed(200);
// Links that nothing is near get finer spheres as long as a query of them measures so many points
// exactly: finer spheres save little else, and a point costs about a microsecond.
constexpr double kExactThatPays = 2.0;

}  // namespace

/// The link to refine next: the one whose next step is the most urgent, of these one that something
/// is near, and of these the one whose queries measure most points exactly. None where no step
/// would pay.
std::optional<std::size_t> ModelLoader::link_to_refine(const ModelState& state) {
  if (!state.is_ready() || !state.anytime) return std::nullopt;
  if (needs_.size() != state.usage->size() || needs_of_ != state.usage) {
    needs_of_ = state.usage;
    needs_.assign(state.usage->size(), {});
  }
  std::optional<std::size_t> chosen;
  const auto next_step = [&](std::size_t i) {
    return AnytimeModel::next_step(state.robot->links[i]);
  };
  const auto is_before = [&](std::size_t a, std::size_t b) {
    if (next_step(a) != next_step(b)) return next_step(a) < next_step(b);
    if (needs_[a].is_near != needs_[b].is_near) return needs_[a].is_near;
    return needs_[a].exact > needs_[b].exact;
  };
  for (std::size_t i = 0; i < needs_.size(); ++i) {
    needs_[i] = state.usage->take(i);
    if (next_step(i) == AnytimeModel::LinkStep::kNone) continue;
    const bool pays = needs_[i].is_near || needs_[i].exact >= kExactThatPays ||
                      config_.self_collision.enabled;  // the width of its answers is the gap
    if (pays && (!chosen || is_before(i, *chosen))) chosen = i;
  }
  return chosen;
}

/// Runs in a thread of its own. Models that have been replaced are freed here, not in the cycle.
void ModelLoader::run_refinement() {
  name_thread("ist packing");
  lower_thread_priority();
  while (!stop_) {
    bool is_finer = false;
    const std::string fault = exception_of([this, &is_finer] {
      while (!stop_ && refine_once()) is_finer = true;
    });
    if (!fault.empty()) {
      ROS_ERROR_STREAM_THROTTLE(5.0, "a link is not packed more finely: " << fault);
    }
    retired_.erase(std::remove_if(retired_.begin(), retired_.end(),
                                  [](const auto& state) { return state.use_count() == 1; }),
                   retired_.end());
    if (is_finer) return_free_memory();  // packing needs some megabytes
    std::unique_lock<std::mutex> lock(mutex_);
    wake_.wait_for(lock, kPollNeed, [this] { return stop_.load(); });
  }
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
