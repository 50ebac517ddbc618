#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "ist_proximity/proximity/proximity_query.h"

namespace ist {

/// The links that need finer packings and contact volumes: what their queries have cost lately, and
/// whether obstacles were near. The cycle writes it, background threads read it, and neither waits.
class LinkUsage {
 public:
  explicit LinkUsage(std::size_t links) : links_(links) {}

  /// Notes one query of a link.
  /// @param is_near  an obstacle is within the influence distance
  void note_query(std::size_t link, const QueryStatistics& statistics, bool is_near) {
    Link& used = links_[link];
    used.exact += statistics.exact_evaluations;
    ++used.queries;
    if (is_near) note_near(link);
  }
  /// Notes that something is within the influence distance of a link.
  void note_near(std::size_t link) {
    links_[link].was_near.store(true, std::memory_order_relaxed);
    links_[link].is_near.store(true, std::memory_order_relaxed);
  }

  /// Whether something has been within the influence distance at any time.
  bool was_near(std::size_t link) const {
    return links_[link].was_near.load(std::memory_order_relaxed);
  }

  /// The need of a link since the last call of take().
  struct Need {
    bool is_near = false;
    double exact = 0.0;  ///< points measured exactly in a query, on average
  };
  Need take(std::size_t link) {
    Link& used = links_[link];
    const auto queries = static_cast<double>(used.queries.exchange(0));
    const auto exact = static_cast<double>(used.exact.exchange(0));
    return {used.is_near.exchange(false), queries > 0.0 ? exact / queries : 0.0};
  }
  std::size_t size() const { return links_.size(); }

 private:
  struct Link {
    std::atomic<std::uint64_t> exact{0}, queries{0};
    std::atomic<bool> is_near{false}, was_near{false};
  };
  std::vector<Link> links_;
};

}  // namespace ist
