#pragma once

#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "ist_proximity/contact/contact_model.h"
#include "ros/common/stop_signal.h"
#include "ros/model/model_loader.h"
#include "ros/parameters/parameters.h"

namespace ist {

/// Makes the contact bodies in a thread of its own, while the node answers already: it packs one
/// monitored link after the other disjointly, or takes it from the cache. It follows every change
/// of the robot's model; links that do not change keep their bodies. All members are thread safe.
class ContactLoader {
 public:
  /// @param loader  outlives this
  ContactLoader(const ServerConfig& config, const ModelLoader& loader);
  /// Stops packing.
  ~ContactLoader();
  ContactLoader(const ContactLoader&) = delete;
  ContactLoader& operator=(const ContactLoader&) = delete;

  /// The bodies made so far; null until a model is ready, and where they are not wanted.
  std::shared_ptr<const ContactModel> contacts() const;

 private:
  void run();
  void load(const std::shared_ptr<const ModelState>& state);
  std::shared_ptr<const ContactGeometry> build(const LinkDescription& link, const LinkModel& model,
                                               const std::function<bool()>& cancelled) const;
  void set(std::shared_ptr<const ContactModel> contacts);
  bool is_current(const ModelState& state) const;

  const ServerConfig config_;
  const ModelLoader& loader_;
  StopSignal stop_signal_;
  mutable std::mutex mutex_;
  std::shared_ptr<const ContactModel> contacts_;  ///< guarded by mutex_
  /// The bodies of the last model by key, for the next one; the thread's own.
  std::map<std::string, std::shared_ptr<const ContactGeometry>> known_;
  std::thread thread_;  ///< not running where contact volumes are not wanted
};

}  // namespace ist
