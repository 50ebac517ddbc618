#pragma once

#include <ros/node_handle.h>

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "ist_proximity/robot/attached_object.h"
#include "ist_proximity/robot/kinematics.h"
#include "ist_proximity/robot/robot_model.h"
#include "ros/parameters/parameters.h"

namespace ist {

/// How far the robot's model is. Immutable.
struct ModelState {
  enum class Phase {
    kWaiting,  ///< robot_description is not set
    kFailed,   ///< it is set, and no URDF
    kPacking,
    kReady,
  };
  Phase phase = Phase::kWaiting;
  std::string problem;                ///< for a person, with what to do; empty when ready
  double fraction = 0.0;              ///< 0 to 1 while packing
  std::string root_link;              ///< empty until the URDF is known
  std::vector<std::string> links;     ///< monitored, in URDF order; known from kPacking on
  std::vector<std::string> warnings;  ///< that packing gave
  /// When ready. Holds every link with geometry, as the self-filter needs, not only the monitored
  /// ones.
  std::shared_ptr<const RobotModel> robot;
  std::vector<std::size_t> monitored;                   ///< when ready: indices into robot->links
  std::shared_ptr<const Kinematics> kinematics;         ///< from kPacking on; null: see the next
  std::string kinematics_problem;                       ///< why it cannot be had
  std::shared_ptr<const RobotDescription> description;  ///< as parsed; from kPacking on
  std::vector<AttachedObject> objects;                  ///< when ready: parts of `robot`
};

/// Makes the robot's model in a thread of its own: waits for robot_description on the parameter
/// server, reads the URDF, packs its links or takes them from the cache. A text that is no URDF is
/// read again as soon as the parameter changes. All members are thread safe.
class ModelLoader {
 public:
  /// @param nh  where `config.robot_description` is searched, and above
  ModelLoader(const ServerConfig& config, const ros::NodeHandle& nh);
  /// Stops packing.
  ~ModelLoader();
  ModelLoader(const ModelLoader&) = delete;
  ModelLoader& operator=(const ModelLoader&) = delete;

  std::shared_ptr<const ModelState> state() const;

  /// Forgets the model at once (the robot may have changed) and reads the description again in the
  /// background.
  /// @returns what happens now; `found` is whether the parameter is set at the moment
  std::string reload(bool* found);

  /// Make an object a part of its link, and end that. The new model takes the old one's place when
  /// it is ready, and before the function returns; until then the old one goes on. Attached objects
  /// survive reload(), unless their link does not.
  /// @returns empty on success, else why not; then nothing has changed
  std::string attach(const AttachedObject& object);
  std::string detach(const std::string& name);

 private:
  void run();
  void load_once();
  bool fetch(std::string* urdf, std::string* problem) const;
  void load(const std::string& urdf);
  std::string change_objects(const std::shared_ptr<const ModelState>& state,
                             std::vector<AttachedObject> objects, const std::string& link);
  RobotModelConfig model_config(const RobotDescription& description,
                                const std::vector<AttachedObject>& objects) const;
  void finish(const RobotDescription& description, ModelState* state) const;
  RobotDescription carry_objects(ModelState* state);
  void set_state(ModelState state);
  void wait();
  bool cancelled() const { return stop_ || reload_; }

  const ServerConfig config_;
  ros::NodeHandle nh_;
  std::string rejected_;  ///< the last text that was no URDF

  mutable std::mutex mutex_;
  std::condition_variable wake_;
  std::shared_ptr<const ModelState> state_;
  std::atomic<bool> stop_{false}, reload_{false};
  std::vector<AttachedObject> objects_;  ///< guarded by mutex_
  std::mutex change_mutex_;              ///< one change of objects after the other
  std::thread thread_;
};

}  // namespace ist
