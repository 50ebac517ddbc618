#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "ist_proximity/contact/contact_model.h"
#include "ros/model/model_loader.h"
#include "ros/parameters/parameters.h"

namespace ist {

/// Makes what contact volumes need, in a thread of its own, after the node answers already: packs
/// one monitored link after the other disjointly, or takes them from the cache. Whatever becomes of
/// the robot's model, it follows; links that stay as they are keep what they have. All members are
/// thread safe.
class ContactLoader {
 public:
  /// @param loader  outlives this
  ContactLoader(const ServerConfig& config, const ModelLoader& loader);
  /// Stops packing.
  ~ContactLoader();
  ContactLoader(const ContactLoader&) = delete;
  ContactLoader& operator=(const ContactLoader&) = delete;

  /// As far as they are; null until a model is ready, and where they are not wanted.
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
  mutable std::mutex mutex_;
  std::condition_variable stop_signal_;
  std::atomic<bool> stop_{false};
  std::shared_ptr<const ContactModel> contacts_;  ///< guarded by mutex_
  /// Of the last model by key, for the next one; the thread's own.
  std::map<std::string, std::shared_ptr<const ContactGeometry>> known_;
  std::thread thread_;  ///< none where they are not wanted
};

}  // namespace ist
