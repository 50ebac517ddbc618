#pragma once

#include <cstddef>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "internal/robot/anytime_model.h"
#include "monitored_links.h"
#include "packing_jobs.h"

namespace ist {

/// A monitored link, its place in the model being its index.
struct AnytimeModel::Link : MonitoredLink {
  std::vector<std::string> keys;       ///< of the shapes, by element
  std::vector<PackingConfig> configs;  ///< of their final stage, by element
  Solid solid;                         ///< empty with an error
};

/// One step from a model to the next.
class AnytimeModel::Step {
 public:
  Step(std::shared_ptr<AnytimeModel> model, RobotModelCallbacks callbacks)
      : model_(std::move(model)), callbacks_(std::move(callbacks)) {}

  // Callbacks are called one at a time.
  bool is_cancelled() const {
    const std::lock_guard<std::mutex> lock(cancel_mutex_);
    return callbacks_.cancelled && callbacks_.cancelled();
  }

  void choose_links();
  bool make_solids(const RobotModel* before, const std::string* changed);
  void forget_unused_shapes();
  void add_unknown_shapes(Stage stage);
  void add_shapes_to_refine(std::size_t index);
  bool pack(int threads);
  /// @param before   supplies the links that are the same; may be null
  /// @param changed  the link whose geometry may differ from `before`
  /// @returns null when cancelled
  Ptr finish(const RobotModel* before, const std::string* changed);

  void touch(const std::string& key) { touched_.insert(key); }

 private:
  Solid solid_of(const Link& link, const LinkModel* before) const;
  void add_job(const Link& link, std::size_t element, const PackingConfig& stage);
  void take(PackingJob* job);
  LinkModel assemble(const Link& link, const LinkModel* before, bool same_geometry) const;
  bool is_touched(const Link& link) const;
  void warn(const RobotModel& robot) const;

  const std::shared_ptr<AnytimeModel> model_;
  const RobotModelCallbacks callbacks_;
  mutable std::mutex cancel_mutex_;
  std::vector<PackingJob> jobs_;
  std::set<std::string> touched_;  ///< keys of shapes that have another packing than before
};

}  // namespace ist
