#pragma once

#include <atomic>
#include <cstddef>
#include <vector>

namespace ist {

/// The links that something has come near, which need final packings and contact volumes. The cycle
/// writes it, background threads read it, and neither waits.
class LinkUsage {
 public:
  explicit LinkUsage(std::size_t links) : was_near_(links) {}

  /// Notes that something is within the influence distance of a link.
  void note_near(std::size_t link) { was_near_[link].store(true, std::memory_order_relaxed); }

  /// Whether something has been within the influence distance at any time.
  bool was_near(std::size_t link) const { return was_near_[link].load(std::memory_order_relaxed); }

  std::size_t size() const { return was_near_.size(); }

 private:
  std::vector<std::atomic<bool>> was_near_;
};

}  // namespace ist
