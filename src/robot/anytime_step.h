#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "internal/geometry/distance_field.h"
#include "internal/robot/anytime_model.h"
#include "monitored_links.h"
#include "packing_jobs.h"

namespace ist {

/// A monitored link, its place in the model being its index.
struct AnytimeModel::Link : MonitoredLink {
  std::vector<std::string> keys;       ///< of the shapes, by element
  std::vector<PackingConfig> configs;  ///< of their final stage, by element
  Solid solid;                         ///< empty with an error
  bool is_pending = false;             ///< it is not made yet
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
  void warn_of_visual_fallback() const;
  /// Begins the links with the least work, up to a share of the work on all; all others are
  /// pending.
  /// @returns false where none is begun that was not before
  bool begin_links(double share);
  /// Progress of this step goes from `begin` to `end` of the whole.
  void set_progress(double begin, double end) {
    progress_begin_ = begin;
    progress_end_ = end;
  }
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

  /// The distance field of a geometry, the same for equal ones: from the cache, or measured.
  /// @param detail  of what is measured where the cache has no fine one
  /// @throws Cancelled
  std::shared_ptr<const DistanceField> field_of(const LinkGeometry& geometry, const Solid& solid,
                                                DistanceField::Detail detail);

 private:
  Solid solid_of(const Link& link, const LinkModel* before) const;
  void add_job(const Link& link, std::size_t element, const PackingConfig& now);
  void take(PackingJob* job);
  LinkModel assemble(const Link& link, const LinkModel* before, bool same_geometry);
  bool is_touched(const Link& link) const;
  void warn(const RobotModel& robot) const;
  void warn(const std::string& warning) const;

  const std::shared_ptr<AnytimeModel> model_;
  const RobotModelCallbacks callbacks_;
  mutable std::mutex cancel_mutex_;
  std::vector<PackingJob> jobs_;
  double progress_begin_ = 0.0, progress_end_ = 1.0;
  std::set<std::string> touched_;  ///< keys of shapes that have another packing than before
  struct Field {
    std::once_flag is_made;
    std::shared_ptr<const DistanceField> field;
  };
  std::mutex fields_mutex_;
  std::map<std::string, Field>
      fields_;  ///< by key; guarded by fields_mutex_, but for their content
};

}  // namespace ist
