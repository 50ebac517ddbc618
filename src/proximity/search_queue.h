#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

namespace ist {

/// The queue of a search, the least bound first. It holds boxes of nodes and tiles, and single
/// obstacles: points, boxes, and parts of boxes. Nothing is allocated.
class SearchQueue {
 public:
  static constexpr std::uint32_t kCapacity = 1024;
  static constexpr int kNoObstacle = -1;

  struct Entry {
    float outside;       ///< [m] every place nearer to it is outside; not positive: unknown
    float distance;      ///< [m] of a point that may be inside: no surface is nearer to it
    std::int32_t child;  ///< node, or tile if negative; the tile of an obstacle
    int lane;            ///< of an obstacle; else kNoObstacle
    /// The children of a node, as in SearchFront::Part; for an obstacle, the number of its tile's
    /// part.
    std::uint32_t slots;
    float radius;          ///< [m] of the box; an upper bound of a point's distance
    float center[3];       ///< [m] of the box, or the point, in the link's frame
    float min[3], max[3];  ///< [m] the box, in the index's frame; of a point, both are its place
    bool is_part;          ///< of an obstacle that is a box
  };

  bool empty() const { return size_ == 0; }
  float least() const { return places_[0].bound; }  ///< [m]; not to be asked of an empty queue

  /// @param bound  [m] of all that is below the entry
  /// @returns the entry, for the caller to fill in; null: the queue is full
  Entry* push(float bound) {
    std::uint32_t at = free_;
    if (at != kNone) {
      free_ = static_cast<std::uint32_t>(entries_[at].child);
    } else if (used_ < kCapacity) {
      at = used_++;
    } else {
      return nullptr;
    }
    places_[size_++] = {bound, at};
    std::push_heap(places_.data(), end(), IsFarther());
    return &entries_[at];
  }

  /// Takes the entry with the least bound.
  /// @returns [m] the bound
  float pop(Entry* entry) {
    std::pop_heap(places_.data(), end(), IsFarther());
    const Place place = places_[--size_];
    *entry = entries_[place.entry];
    entries_[place.entry].child = static_cast<std::int32_t>(free_);
    free_ = place.entry;
    return place.bound;
  }

  /// Calls visit(bound, entry) with each entry, in any order.
  template <class Visit>
  void for_each(const Visit& visit) const {
    for (std::size_t i = 0; i < size_; ++i) visit(places_[i].bound, entries_[places_[i].entry]);
  }

 private:
  static constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();
  struct Place {
    float bound;
    std::uint32_t entry;
  };
  struct IsFarther {
    bool operator()(const Place& a, const Place& b) const { return a.bound > b.bound; }
  };
  Place* end() { return places_.data() + size_; }

  std::size_t size_ = 0;
  std::uint32_t used_ = 0,
                free_ = kNone;  // entries that were in use; the list of those that are not
  std::array<Place, kCapacity> places_;
  std::array<Entry, kCapacity> entries_;
};

}  // namespace ist
