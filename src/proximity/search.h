#pragma once

#include <algorithm>
#include <array>
#include <cassert>
#include <cstdint>
#include <limits>

#include "internal/bvh/padded_box.h"
#include "internal/bvh/prefetch.h"
#include "internal/geometry/float_rounding.h"
#include "proximity/coherence/search_front.h"
#include "proximity/link_bounds.h"
#include "proximity/search_queue.h"

namespace ist {

/// The question to a search. Its lower bounds have an error of PlacedLink::rounding, which callers
/// take off; `prune_bound` contains it already.
struct SearchInput {
  PlacedLink link;
  SearchQueue* queue = nullptr;  ///< empty; the search leaves anything in it
  SearchFront* front = nullptr;  ///< begun, and ended by the search; null: there is none
  /// [m] What has a lower bound that is not below it is pruned.
  float prune_bound = std::numeric_limits<float>::infinity();
};

struct SearchOutcome {
  /// [m] Least lower bound of the signed distances of all that is pruned.
  float pruned_bound = std::numeric_limits<float>::infinity();
  /// [m] Every place that is nearer than this to an obstacle is outside; not positive: unknown.
  float outside_bound = std::numeric_limits<float>::infinity();
  bool has_inside = false;  ///< an obstacle is inside, and was measured
  bool has_time = true;     ///< false: the deadline passed; `pruned_bound` bounds what was left
  std::uint64_t nodes = 0, tiles = 0;  ///< that were expanded
};

/// The search for the obstacle of an index that is nearest to a link, or deepest inside it: branch
/// and bound over the index's boxes, best first (Hjaltason and Samet 1999).
///
///     queue <- the parts of the front that its bounds do not prune, or the root
///     while the least bound in the queue is below what is asked for
///         take the entry with that bound
///         an obstacle: measure it exactly, which lowers what is asked for
///         a tile:      bound its obstacles side by side
///         a node:      bound its children side by side
///         queue <- what is below what is asked for; front <- the rest
///     front <- the queue
///
/// The bounds are signed (see LinkBounds), so that contact, depth and distance are one search. At
/// any moment no obstacle has a smaller signed distance than the least of the queue's first bound,
/// of what was pruned, and of what was measured: so the search may stop at any time. A queue that
/// is full goes on depth first. Nearly always a single obstacle is measured, the nearest one.
///
/// @tparam Measure  measures obstacles: PointMeasure, BoxMeasure, or ExtentMeasure of one of them
template <class Measure>
class Search {
 public:
  Search(const SearchInput& input, const typename Measure::Bvh& bvh, Measure* measure)
      : in_(input),
        bvh_(bvh),
        measure_(*measure),
        queue_(*input.queue),
        link_(input.link),
        bounds_(link_),
        limit_(input.prune_bound) {}
  // bounds_ refers to link_.
  Search(const Search&) = delete;
  Search& operator=(const Search&) = delete;
  ~Search() = default;

  SearchOutcome run() {
    begin();
    Entry entry{};
    while (!queue_.empty() && queue_.least() < limit_ && outcome_.has_time) {
      const float bound = queue_.pop(&entry);
      visit(entry, bound);
    }
    queue_.for_each([this](float bound, const Entry& left) { prune(left, bound, left.outside); });
    if (in_.front != nullptr) in_.front->end(true);
    return outcome_;
  }

 private:
  using Entry = SearchQueue::Entry;
  static constexpr int kNoObstacle = SearchQueue::kNoObstacle;
  // A search that has visited so many tiles and measured nothing measures an obstacle: the link's
  // supporting plane across its direction may separate the link from all others, as from a table.
  static constexpr std::uint64_t kTilesBeforePlane = 4;
  // A search that has measured so many turns the plane, and again each time that there are twice as
  // many.
  static constexpr int kMeasuredBeforePlane = 8;

  // Begins with what the front does not prune, or with the root.
  void begin() {
    if (in_.front == nullptr || in_.front->empty()) {
      Entry root{};
      root.child = bvh_.root();
      root.lane = kNoObstacle;
      root.slots = SearchFront::kAllSlots;
      const PaddedBox box = bounds_of(bvh_.nodes()[static_cast<std::size_t>(root.child)]);
      bounds_.place_box(box.min.data(), box.max.data(), &root);
      return visit(root, kMayBeInside);
    }
    const SearchFront::LeastBounds left = in_.front->remove_below(
        limit_, link_.is_closed, [this](const SearchFront::Part& part) { push_part(part); });
    lower(left.bound, left.outside);
  }

  void push_part(const SearchFront::Part& part) {
    Entry entry{};
    entry.outside = part.outside;
    entry.child = part.child;
    entry.lane = kNoObstacle;
    entry.slots = part.slots;
    bounds_.place_box(part.min, part.max, &entry);
    // Near holes no plane tells inside from outside.
    const bool is_outside = link_.is_closed || part.outside > 0.0F;
    float bound = is_outside ? part.bound : kMayBeInside;
    if (is_outside && !Measure::kHasExtent) {
      const float height = bounds_.height(entry);
      bound = std::max(bound, height);
      if (link_.is_closed) entry.outside = std::max(entry.outside, height);
    }
    Entry* place = queue_.push(bound);
    assert(place != nullptr);  // a front is smaller than the queue
    *place = entry;
  }

  // An entry that is pushed into a full queue is visited at once.
  void push(const Entry& entry, float bound) {
    Entry* place = queue_.push(bound);
    if (place != nullptr) {
      *place = entry;
    } else if (bound < limit_) {
      visit(entry, bound);
    } else {
      prune(entry, bound, entry.outside);
    }
  }

  void visit(const Entry& entry, float bound) {
    outcome_.has_time = outcome_.has_time && measure_.has_time(bound);
    if (!outcome_.has_time) return prune(entry, bound, entry.outside);
    if (is_place_of_last(entry)) return keep(entry, last_.bound, last_.outside);
    if (has_new_plane_) {
      const float height = bounds_.height(entry);
      // Near holes no plane tells inside from outside.
      if (height >= limit_ && (link_.is_closed || entry.outside > 0.0F)) {
        return prune(entry, height, link_.is_closed ? height : entry.outside);
      }
    }
    if (entry.lane != kNoObstacle) return measure(entry, bound);
    if (entry.child < 0) {
      visit_tile(entry);
    } else {
      expand_node(entry, bound);
    }
  }

  // Whether all that an entry holds is where the last obstacle was measured: of equal points one
  // is enough.
  bool is_place_of_last(const Entry& entry) const {
    return last_.is_known && std::equal(entry.min, entry.min + 3, last_.place.begin()) &&
           std::equal(entry.max, entry.max + 3, last_.place.begin());
  }

  void lower(float bound, float outside) {
    outcome_.pruned_bound = std::min(outcome_.pruned_bound, bound);
    outcome_.outside_bound = std::min(outcome_.outside_bound, outside);
  }

  void prune(const Entry& entry, float bound, float outside) {
    lower(bound, outside);
    keep(entry, bound, outside);
  }

  // Keeps the bound of an entry for the poses to come.
  void keep(const Entry& entry, float bound, float outside) {
    if (entry.lane == kNoObstacle) {
      keep_slots(entry, entry.slots, bound, outside);
    } else if (in_.front != nullptr) {
      in_.front->lower(entry.slots, bound, outside);
    }
  }
  // The same for some children of a node, or for a tile.
  // @returns the number of the part
  std::uint32_t keep_slots(const Entry& entry, std::uint32_t slots, float bound, float outside) {
    if (in_.front == nullptr) return 0;
    SearchFront::Part part{bound, outside, entry.child, slots, {}, {}};
    std::copy_n(entry.min, 3, part.min);
    std::copy_n(entry.max, 3, part.max);
    return in_.front->add(part);
  }

  void expand_node(const Entry& entry, float entry_bound) {
    Corners corners;
    const bool has_corners = bounds_.has_corners(entry, entry_bound);
    if (has_corners) bounds_.bound_corners(entry, &corners);
    if (has_corners && !Measure::kHasExtent && corners.box_bound >= limit_) {
      return prune(entry, corners.box_bound, entry.outside);
    }
    ++outcome_.nodes;
    const BoxNode& node = bvh_.nodes()[static_cast<std::size_t>(entry.child)];
    Bounds bounds;
    lower_limit(bounds_.bound_boxes(BoxRows(node), entry, has_corners ? &corners : nullptr,
                                    enough(), &bounds));
    measure_.take_extents(BoxRows(node), &bounds);
    const std::uint32_t slots = entry.slots & first_slots(node.count);
    const auto [below, bound, outside] = split_slots(slots, limit_, &bounds);
    lower(bound, outside);
    if (slots != below) keep_slots(entry, slots & ~below, bound, outside);
    prefetch_least(bounds, below, node);
    for (std::uint32_t bits = below; bits != 0; bits &= bits - 1) {
      const int k = __builtin_ctz(bits);
      Entry child = entry_of(bounds, k);
      child.child = node.child[k];
      child.lane = kNoObstacle;
      child.slots = SearchFront::kAllSlots;
      set_box(BoxRows(node), k, &child);
      push(child, bounds.distance[k]);
    }
  }

  // The child that has the least bound is most often the next one to be expanded.
  void prefetch_least(const Bounds& bounds, std::uint32_t below, const BoxNode& node) const {
    float least = kFarAway;
    std::int32_t next = 0;
    for (std::uint32_t bits = below; bits != 0; bits &= bits - 1) {
      const int k = __builtin_ctz(bits);
      next = bounds.distance[k] < least ? node.child[k] : next;
      least = std::min(least, bounds.distance[k]);
    }
    if (below != 0) prefetch_child(bvh_, next);
  }

  void visit_tile(const Entry& entry) {
    ++outcome_.tiles;
    typename Measure::Bvh::Tile scratch;
    const auto& tile = bvh_.tile(static_cast<std::size_t>(~entry.child), &scratch);
    Bounds bounds;
    lower_limit(bound_tile(tile, entry, &bounds));
    assert(tile.count > 0);  // lower_limit() relies on it for every box
    const std::uint32_t part = keep_slots(entry, SearchFront::kAllSlots, kFarAway, kFarAway);
    std::uint32_t slots = first_slots(tile.count);
    if (outcome_.tiles >= kTilesBeforePlane && measured_ == 0) {
      slots &= ~measure_least(entry, part, tile, bounds);
    }
    const auto [below, bound, outside] = split_slots(slots, limit_, &bounds);
    lower(bound, outside);
    if (in_.front != nullptr) in_.front->lower(part, bound, outside);
    for (std::uint32_t bits = below; bits != 0; bits &= bits - 1) {
      const int k = __builtin_ctz(bits);
      push(obstacle(entry, part, tile, bounds, k), bounds.distance[k]);
    }
  }

  float bound_tile(const PointTile& tile, const Entry& box, Bounds* bounds) {
    const float farthest = bounds_.bound_points(tile, box, enough(), bounds);
    measure_.take_extents(tile, bounds);
    return farthest;
  }
  float bound_tile(const BoxTile& tile, const Entry& box, Bounds* bounds) {
    const float farthest = bounds_.bound_boxes(BoxRows(tile), box, nullptr, enough(), bounds);
    measure_.take_extents(BoxRows(tile), bounds);
    return farthest;
  }

  // [m] A radius that is taken off may ask for any bound.
  float enough() const { return Measure::kHasExtent ? kFarAway : limit_; }

  static Entry entry_of(const Bounds& bounds, int k) {
    Entry entry{};
    entry.outside = bounds.outside[k];
    entry.distance = bounds.surface[k];
    entry.radius = bounds.radius[k];
    entry.center[0] = bounds.x[k];
    entry.center[1] = bounds.y[k];
    entry.center[2] = bounds.z[k];
    return entry;
  }
  template <class Tile>
  static Entry obstacle(const Entry& box, std::uint32_t part, const Tile& tile,
                        const Bounds& bounds, int k) {
    Entry entry = entry_of(bounds, k);
    entry.child = box.child;
    entry.lane = k;
    entry.slots = part;
    set_box(tile, k, &entry);
    return entry;
  }
  static void set_box(const BoxRows& boxes, int k, Entry* entry) {
    for (int i = 0; i < 3; ++i) {
      entry->min[i] = boxes.min[i][k];
      entry->max[i] = boxes.max[i][k];
    }
  }
  static void set_box(const BoxTile& tile, int k, Entry* entry) {
    set_box(BoxRows(tile), k, entry);
  }
  static void set_box(const PointTile& tile, int k, Entry* entry) {
    entry->min[0] = entry->max[0] = tile.x[k];
    entry->min[1] = entry->max[1] = tile.y[k];
    entry->min[2] = entry->max[2] = tile.z[k];
  }

  static std::uint32_t first_slots(int count) { return (1U << static_cast<unsigned>(count)) - 1U; }

  // Measures the obstacle of a tile that has the least bound, if it is known to be outside, and
  // looks for a plane across its direction.
  // @param part  of the tile
  // @returns the slot of the obstacle as a bit; 0: none was measured
  template <class Tile>
  std::uint32_t measure_least(const Entry& box, std::uint32_t part, const Tile& tile,
                              const Bounds& bounds) {
    const float* least = std::min_element(bounds.distance, bounds.distance + tile.count);
    const auto k = static_cast<int>(least - bounds.distance);
    if (!(bounds.outside[k] > 0.0F) || !(*least < limit_)) return 0;
    measure(obstacle(box, part, tile, bounds, k), *least);
    turn_plane();
    return 1U << static_cast<unsigned>(k);
  }

  // Some obstacle is no farther than this. It will be measured: its lower bound is less.
  void lower_limit(float distance) { limit_ = std::min(limit_, distance + link_.rounding); }
  void take_limit() { limit_ = std::min(limit_, measure_.traversal_prune_bound()); }

  // Measures an obstacle, and decides on which side it is where that is not known.
  void measure(const Entry& entry, float bound) {
    if (Measure::kHasExtent || entry.outside > 0.0F) return measure_outside(entry, bound);
    if constexpr (Measure::kHasBoxes) {
      measure_box(entry, bound);
    } else {
      ask(entry, bound);
    }
  }

  void measure_outside(const Entry& entry, float bound) {
    ++measured_;
    outcome_.outside_bound = std::min(outcome_.outside_bound, entry.outside);
    const float measured = std::max(bound, measure_.measure_outside(entry, link_.rounding));
    remember(entry, measured, entry.outside);
    keep(entry, measured, entry.outside);
    take_limit();
    if (measured_ >= kMeasuredBeforePlane && (measured_ & (measured_ - 1)) == 0) turn_plane();
  }

  void turn_plane() { has_new_plane_ = measure_.turn_plane(&link_) || has_new_plane_; }

  void remember(const Entry& entry, float bound, float outside) {
    last_ = {true, {entry.min[0], entry.min[1], entry.min[2]}, bound, outside};
  }

  // Decides on which side a point is. If it is outside, its distance may still not matter.
  void ask(Entry point, float bound) {
    SideBalls::Found found = measure_.known_side(point);
    float margin = round_down(found.margin) - link_.rounding;
    if (!(margin > 0.0F)) {
      // While another point is inside, one that is near the surface is not deeper, whatever its
      // side: a distance costs less than a winding number.
      if (limit_ < 0.0F && measure_.is_surface_within(point, -limit_ - link_.rounding)) {
        remember(point, limit_, 0.0F);
        return prune(point, limit_, 0.0F);
      }
      found = measure_.ask_side(point, point.distance - link_.rounding);
      margin = round_down(found.margin) - link_.rounding;
    }
    if (found.side == SideBalls::Side::kUnknown) {
      outcome_.has_time = false;
      return prune(point, bound, 0.0F);
    }
    if (found.side == SideBalls::Side::kInside) {
      ++measured_;
      outcome_.has_inside = true;
      bound = std::max(bound, measure_.measure_inside(point, link_.rounding));
      remember(point, bound, 0.0F);
      keep(point, bound, 0.0F);
      return take_limit();
    }
    // A margin that is not known is taken for the least one.
    point.outside = std::max(margin, std::numeric_limits<float>::min());
    const float distance = std::max(point.distance, 0.0F);
    if (distance >= limit_) return prune(point, distance, point.outside);
    push(point, distance);
  }

  // Measures a box that may be inside. What is inside is divided: the part that may be deepest
  // comes first.
  void measure_box(Entry box, float bound) {
    if (!box.is_part) {
      ++measured_;
      const auto found = measure_.measure_box(&box);
      take_limit();
      bound = std::max(bound, found.bound);
      if (found.is_outside) {
        // A margin that is not known is taken for the least one.
        const float outside = link_.is_closed ? found.bound : std::numeric_limits<float>::min();
        outcome_.outside_bound = std::min(outcome_.outside_bound, outside);
        remember(box, bound, outside);
        return keep(box, bound, outside);
      }
      outcome_.has_inside = true;
    }
    if (bound >= limit_ || !measure_.may_divide(bound)) return prune(box, bound, 0.0F);
    std::array<Entry, 2> halves{box, box};
    const std::array<float, 2> least = measure_.divide(&halves);
    take_limit();
    for (std::size_t i = 0; i < 2; ++i) {
      Entry* place = least[i] < limit_ ? queue_.push(least[i]) : nullptr;
      if (place == nullptr) {
        prune(halves[i], least[i], 0.0F);
      } else {
        *place = halves[i];
      }
    }
  }

  const SearchInput& in_;
  const typename Measure::Bvh& bvh_;
  Measure& measure_;
  SearchQueue& queue_;
  PlacedLink link_;
  LinkBounds bounds_;
  float limit_;                 // [m]
  bool has_new_plane_ = false;  // which entries of the queue do not know
  int measured_ = 0;            // obstacles
  struct {
    bool is_known = false;
    std::array<float, 3> place{};        // [m] in the index's frame
    float bound = 0.0F, outside = 0.0F;  // [m]
  } last_;                               // the obstacle that was measured last
  SearchOutcome outcome_;
};

}  // namespace ist
