#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <limits>

#include "internal/geometry/ray_cast.h"
#include "internal/geometry/triangle_bvh.h"
#include "ist_proximity/geometry/solid.h"

namespace ist {

/// Rays from one point in nearly the same direction, such as those of neighbouring pixels, against
/// one solid. The part of the solid that any of them may meet is searched once; each ray is then
/// tested against that part alone. The hits are those of ray_cast(). Allocates nothing.
class RayBundle {
 public:
  /// @param solid         viewed until the next begin()
  /// @param origin_L      [m] link frame
  /// @param directions_L  box that holds the directions of all rays of cast(), none of length 0
  /// @param max_t         hits beyond are not found
  void begin(const Solid& solid, const Eigen::Vector3d& origin_L,
             const Eigen::AlignedBox3d& directions_L, double max_t);
  /// No ray of the bundle meets the solid.
  bool empty() const { return part_count_ == 0; }

  /// @param max_t  at most that of begin()
  RayHit cast(const Eigen::Vector3d& direction_L, double max_t) const;

 private:
  // A bundle of 4 x 4 pixels meets some 20 leaves of a fine mesh, eight in each; where it meets
  // more than there is room for, each ray searches for itself.
  static constexpr std::size_t kMostLeaves = 16;
  static constexpr std::size_t kMostParts = 16;

  // An element that rays may meet.
  struct Part {
    std::size_t element;      // of the solid
    std::size_t first, last;  // in leaves_; equal: the whole element
  };

  void add_element(std::size_t element, const Eigen::Vector3d& origin_L,
                   const Eigen::AlignedBox3d& directions_L, double max_t);

  const Solid* solid_ = nullptr;
  Eigen::Vector3d origin_L_ = Eigen::Vector3d::Zero();
  std::array<Part, kMostParts> parts_;
  std::size_t part_count_ = 0, leaf_count_ = 0;
  std::array<TriangleBvh::Boxes, kMostLeaves> leaves_;
  bool is_whole_ = false;  // too many elements: each ray is cast against the solid
};

}  // namespace ist
