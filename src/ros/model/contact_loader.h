#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "ist_proximity/contact/contact_model.h"
#include "ros/model/model_loader.h"
#include "ros/parameters/parameters.h"

namespace ist {

/// Makes the contact bodies, while the node answers already: it packs the monitored links that need
/// one disjointly, one after the other, or takes them from the cache. Those are, with
/// ~penetration/enabled: auto, the links that something has come near. It follows every change of
/// the robot's model; links that do not change keep their bodies.
///
/// A volume is summed over the inner spheres of the packing for distances, too. So it is made when
/// that packing is final, and the wrench does not jump while it gets finer; but not later than
/// kMaxWait after it was needed first. All members but pack_when_due() are thread safe.
class ContactLoader {
 public:
  /// @param loader          outlives this
  /// @param is_interrupted  asked now and then; true ends the work of pack_when_due()
  ContactLoader(const ServerConfig& config, const ModelLoader& loader,
                std::function<bool()> is_interrupted)
      : config_(config), loader_(loader), is_interrupted_(std::move(is_interrupted)) {}

  /// Makes the bodies that are due. It is called again and again by one thread, which has the
  /// priority of all others: something is in contact, and waits for it.
  void pack_when_due();

  /// The bodies made so far; null until a model is ready, and where they are not wanted.
  std::shared_ptr<const ContactModel> contacts() const { return std::atomic_load(&contacts_); }

  /// How long a volume waits for the final packing of its link.
  static constexpr std::chrono::seconds kMaxWait{10};

 private:
  using Clock = std::chrono::steady_clock;

  bool follow();
  void begin(const ModelState& state);
  bool is_needed(const ModelState& state, std::size_t link);
  bool add_next(const ModelState& state);
  std::shared_ptr<const ContactGeometry> build(const LinkDescription& link, const LinkModel& model,
                                               const std::function<bool()>& cancelled) const;
  bool is_current(const ModelState& state) const;

  const ServerConfig config_;
  const ModelLoader& loader_;
  const std::function<bool()> is_interrupted_;
  std::shared_ptr<const ContactModel> contacts_;  ///< loaded and stored atomically
  // The thread's own.
  /// The bodies of this model and the last one by key.
  std::map<std::string, std::shared_ptr<const ContactGeometry>> known_;
  AnytimeModel::Ptr model_;                ///< has the description of the links
  std::vector<std::string> keys_;          ///< by link of the robot; empty: it has no body
  std::vector<Clock::time_point> needed_;  ///< by link of the robot: since when; max(): not yet
};

}  // namespace ist
