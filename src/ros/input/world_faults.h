#pragma once

#include <chrono>
#include <cstddef>
#include <iterator>
#include <map>
#include <string>
#include <utility>

namespace ist {

/// The subject of a fault of a known world. The first ones are shown first.
enum class WorldFaultKind {
  kScene,       ///< the scene that the sender mirrors is not known: until it is
  kConfigured,  ///< parameters and the file: for good, because they are never sent again
  kMessage,     ///< a message that was refused whole: until all objects are replaced
  kOctomap,     ///< the octomap: until the next one
  kRobot,       ///< the other robot: until it is read
  kWork,        ///< the source's thread: until it succeeds
  kMany,        ///< more faults than are kept: until all objects are replaced
  kClash,       ///< a mirror's object with the name of a configured one
  kShape,       ///< an object's last description: until another one is used
  kObject       ///< an object
};

/// A kind of fault and, from kClash on, the object's name. Names come from outside, so they are no
/// keys by themselves.
using WorldFaultKey = std::pair<WorldFaultKind, std::string>;

/// The faults of a known world, by subject. The world is not OK until there is none.
using WorldFaults = std::map<WorldFaultKey, std::string>;

inline WorldFaultKey object_fault(const std::string& name) {
  return {WorldFaultKind::kObject, name};
}
inline WorldFaultKey shape_fault(const std::string& name) { return {WorldFaultKind::kShape, name}; }
inline WorldFaultKey fault_of(WorldFaultKind kind) { return {kind, ""}; }

/// Decides which faults are logged: each sentence once a minute, and no more than kMost of them. A
/// sender may repeat a message that cannot be used many times a second, and each may differ.
class WorldFaultLog {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::size_t kMost = 20;
  static constexpr std::chrono::seconds kPeriod{60};

  bool is_due(const std::string& sentence, Clock::time_point now) {
    for (auto one = told_.begin(); one != told_.end();) {
      one = now - one->second >= kPeriod ? told_.erase(one) : std::next(one);
    }
    return told_.size() < kMost && told_.emplace(sentence, now).second;
  }

 private:
  std::map<std::string, Clock::time_point> told_;  ///< when
};

}  // namespace ist
