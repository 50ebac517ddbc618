#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <vector>

#include "ist_proximity/geometry/shapes.h"
#include "proximity/world_shape.h"

namespace ist {

/// The shapes of a world's objects by their geometry, so that objects of equal geometry share one,
/// and one that is sent again is not built again. It keeps no shape that nobody else has. One
/// thread.
class ShapeCache {
 public:
  struct Entry {
    std::shared_ptr<const LinkGeometry> geometry;  ///< null: not found
    std::shared_ptr<const WorldShape> shape;
  };

  /// Finds a shape whose geometry is the same to the last bit.
  Entry find(const LinkGeometry& geometry) const;
  void add(const Entry& entry);
  std::size_t size() const { return entries_.size(); }  ///< with those that nobody has any more

 private:
  struct Weak {
    std::weak_ptr<const LinkGeometry> geometry;
    std::weak_ptr<const WorldShape> shape;
  };
  std::multimap<std::uint64_t, Weak> entries_;  // by hash
  std::size_t next_cleaning_ = 64;              // size
};

/// Finds the geometries of a batch that are the same to the last bit.
/// @returns by geometry: the index of the first one that is the same
std::vector<std::size_t> first_of_same(const std::vector<const LinkGeometry*>& geometries);

}  // namespace ist
