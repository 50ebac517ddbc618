#include "ros/cycle/scene_warm_up.h"

#include <utility>

#include "ist_proximity/repulsion/repulsion.h"
#include "ros/common/stopwatch.h"

namespace ist {
namespace {

// [s] A snapshot is handed on after so much time at the latest.
constexpr double kLongest = 0.005;

}  // namespace

void SceneWarmUp::begin(std::unique_ptr<CoherentQueries> spare) {
  const std::lock_guard<std::mutex> lock(mutex_);
  spare_ = std::move(spare);
  spare_obstacles_ = 0;
  has_scene_ = false;
  ++generation_;
}

void SceneWarmUp::note(const AskedScene& scene) {
  const std::unique_lock<std::mutex> lock(mutex_, std::try_to_lock);
  if (!lock.owns_lock()) return;
  newest_ = scene;
  has_scene_ = true;
}

bool SceneWarmUp::exchange(std::uint64_t obstacles, std::unique_ptr<CoherentQueries>* own) {
  const std::unique_lock<std::mutex> lock(mutex_, std::try_to_lock);
  if (!lock.owns_lock() || !spare_ || spare_obstacles_ != obstacles) return false;
  own->swap(spare_);
  spare_obstacles_ = 0;
  return true;
}

double SceneWarmUp::run(const ObstacleSource& source, const SourceSnapshot& fresh) {
  const std::unique_lock<std::mutex> running(run_mutex_, std::try_to_lock);
  if (!running.owns_lock()) return 0.0;
  Stopwatch watch;
  held_.clear();
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (has_ended_ || !has_scene_) return 0.0;
    scene_ = newest_;
  }
  if (!select_clouds(source, fresh)) return 0.0;
  std::unique_ptr<CoherentQueries> queries;
  std::uint64_t generation = 0;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!has_scene_ || !spare_) return 0.0;
    queries = std::move(spare_);
    generation = generation_;
  }
  queries->warm_up(scene_.X_FL, scene_.known, clouds_, scene_.query, scene_.repulsion, kLongest);
  const std::uint64_t obstacles = obstacles_key(clouds_);
  held_.clear();
  const std::lock_guard<std::mutex> lock(mutex_);
  if (generation == generation_) {
    spare_ = std::move(queries);
    spare_obstacles_ = obstacles;
  }
  return watch.lap();
}

void SceneWarmUp::end() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    has_ended_ = true;
  }
  const std::lock_guard<std::mutex> wait(run_mutex_);
}

/// Finds the clouds of the scene with the fresh one in place of its source's last one.
/// @returns false where that source has no part in the scene, or another one has none to share
bool SceneWarmUp::select_clouds(const ObstacleSource& source, const SourceSnapshot& fresh) {
  clouds_.clear();
  bool is_part = false;
  for (const int number : scene_.sources) {
    const auto i = static_cast<std::size_t>(number);
    const std::size_t parent = parent_of(sources_, i);
    const SourceSnapshot* snapshot = &fresh;
    if (sources_[parent].get() != &source) {  // held until the warm-up ends
      held_.push_back(sources_[parent]->share(scene_.request));
      snapshot = held_.back().get();
    } else if (parent == i) {
      is_part = true;
    }
    if (snapshot != nullptr && parent != i) snapshot = snapshot->memory.get();
    if (snapshot == nullptr) return false;
    add_clouds(*snapshot, &clouds_);
  }
  return is_part;
}

}  // namespace ist
