#pragma once

#include <ros/node_handle.h>

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "internal/geometry/cancelled.h"
#include "ist_proximity/robot/robot_model.h"
#include "ros/common/callback_thread.h"
#include "ros/model/model_state.h"
#include "ros/parameters/parameters.h"

namespace ist {

/// Makes the robot's model: it waits for robot_description on the parameter server, reads the URDF,
/// and packs its links coarsely or takes them from the cache. After a text that is no URDF it reads
/// again as soon as the parameter changes. A thread of its own, of low priority, measures the
/// distance fields of all links, and packs finely those that need it. All members are thread safe.
class ModelLoader {
 public:
  /// @param nh  namespace in which, and above which, `config.robot_description` is searched
  ModelLoader(const ServerConfig& config, const ros::NodeHandle& nh);
  ~ModelLoader() { stop(); }

  /// Loads the model where that is due, and returns when that is done. One thread calls it again
  /// and again.
  void load_when_due();
  /// Ends loading and packing, now and from now on.
  void stop() { stop_ = true; }

  std::shared_ptr<const ModelState> state() const;

  /// Forgets the model at once, because the robot may have changed, and reads the description again
  /// in the background.
  /// @param found  whether the parameter is set at the moment
  /// @returns a sentence about what happens now
  std::string reload(bool* found);

  /// Makes the object to attach. True of the request ends its work.
  /// @throws ModelError, Cancelled
  using ObjectReader = std::function<AttachedObject(const CancelRequest&)>;

  /// Makes an object a part of its link, or removes it again. The old model stays in use until the
  /// new one replaces it, which happens before the function returns. Attached objects survive
  /// reload() as long as their link does. attach() is cancelled by detach() of the same name, by
  /// reload(), by end_changes() and after 30 s. detach() works at any time: a model that is being
  /// loaded is loaded again without the object.
  /// @returns empty on success, else the reason; then nothing has changed
  std::string attach(const std::string& name, const ObjectReader& read);
  std::string detach(const std::string& name);

  /// Ends attach() and detach(), now and from now on.
  void end_changes() { changes_ended_ = true; }

 private:
  void load_once();
  void fail(const std::string& fault);
  std::string waiting_for_description() const;
  bool fetch_urdf(std::string* urdf, std::string* problem) const;
  void load(const std::string& urdf);
  bool build(const std::shared_ptr<const RobotDescription>& description, ModelState* state);
  std::string attach_read(const std::string& name, const ObjectReader& read);
  std::string detach_from(const std::shared_ptr<const ModelState>& state, const std::string& name);
  std::optional<std::string> detach_while_loading(const std::string& name);
  std::string change_objects(const std::shared_ptr<const ModelState>& state,
                             std::vector<AttachedObject> objects, const std::string& link);
  void begin_change(const std::string& name);
  bool change_cancelled() const;
  std::string why_cancelled() const;
  bool show_reading(const std::string& link, const std::string& mesh);
  void read_rules(ModelState* state);
  void choose(ModelState* state) const;
  RobotModelConfig model_config(const ModelState& state) const;
  static void take_robot(const AnytimeModel::Ptr& made, ModelState* state);
  void finish(const RobotDescription& description, ModelState* state) const;
  RobotDescription carry_over_objects(ModelState* state);
  void set_state(ModelState state);
  void refine();
  bool refine_once();
  bool needs_final_packing(const ModelState& state, std::size_t link) const;
  std::optional<std::size_t> link_to_refine(const ModelState& state) const;
  void take_packings(const ModelState& base, const AnytimeModel::Ptr& refined,
                     const std::vector<std::string>& warnings);
  bool cancelled() const { return stop_ || reload_; }

  const ServerConfig config_;
  ros::NodeHandle nh_;
  std::string rejected_;  ///< the last text that was no URDF; the loading thread's own
  std::chrono::steady_clock::time_point next_load_;  ///< the same

  mutable std::mutex mutex_;
  std::shared_ptr<const ModelState> state_;
  std::atomic<bool> stop_{false}, reload_{false};
  std::vector<AttachedObject> objects_;  ///< guarded by mutex_
  std::mutex change_mutex_;              ///< orders changes of objects
  std::string changing_;                 ///< the object that is being attached; guarded by mutex_
  std::atomic<bool> change_revoked_{false};  ///< the same object was detached meanwhile
  std::atomic<bool> changes_ended_{false};
  std::chrono::steady_clock::time_point change_deadline_;  ///< guarded by change_mutex_

  std::vector<std::shared_ptr<const ModelState>> retired_;  ///< the refining thread's own

  CallbackThread refining_thread_;
};

}  // namespace ist
