#pragma once

#include <array>
#include <cstddef>

#include "internal/geometry/box_distance.h"
#include "proximity/posed_index.h"

namespace ist {

/// The boxes of an index that a traversal could not prove to be outside a closed link, as far as
/// there is room for them. While there is, nothing else can be inside, and the depth search needs
/// no traversal of its own.
class BoxesInside {
 public:
  struct Entry {
    ObstacleId id;
    BoxDistance found;  ///< between the box and the link's surface
  };

  void clear() {
    count_ = 0;
    is_complete_ = true;
  }
  void give_up() { is_complete_ = false; }
  void add(ObstacleId id, const BoxDistance& found) {
    if (count_ == entries_.size()) return give_up();
    entries_[count_++] = {id, found};
  }
  bool contains(ObstacleId id) const {
    for (const Entry& entry : *this) {
      if (entry.id.key() == id.key()) return true;
    }
    return false;
  }

  /// Whether all boxes that may be inside are among these.
  bool is_complete() const { return is_complete_; }
  const Entry* begin() const { return entries_.data(); }
  const Entry* end() const { return entries_.data() + count_; }

 private:
  std::array<Entry, 32> entries_;
  std::size_t count_ = 0;
  bool is_complete_ = false;
};

}  // namespace ist
