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

/// Sixteen rays from one point in nearly the same direction, such as those of neighbouring pixels,
/// against one solid. The part of the solid that any of them may meet is searched once; rays are
/// then tested together against that part alone. The hits are those of ray_cast(). Allocates
/// nothing.
class RayBundle {
 public:
  static constexpr std::size_t kRays = 16;
  /// Directions as columns, of any length but 0.
  using Directions = TriangleBvh::Directions;

  /// @param solid         viewed until the next begin()
  /// @param origin_L      [m] link frame
  /// @param directions_L  of the rays
  /// @param rays          bit k: ray k is one of the bundle. The others' directions are not used
  /// @param max_t         hits beyond are not found
  void begin(const Solid& solid, const Eigen::Vector3d& origin_L, const Directions& directions_L,
             std::uint32_t rays, double max_t);
  /// No ray of the bundle meets the solid.
  bool empty() const { return part_count_ == 0; }

  /// Casts some rays of the bundle.
  /// @param rays   bits of these rays
  /// @param max_t  by ray: at most that of begin()
  /// @param hits   receives them, by ray
  void cast(std::uint32_t rays, const std::array<double, kRays>& max_t,
            std::array<RayHit, kRays>* hits) const;

 private:
  // A bundle of 4 x 4 pixels meets some 20 leaves of a fine mesh; where it meets more than there is
  // room for, each ray searches for itself.
  static constexpr std::size_t kMostLeaves = 128;
  static constexpr std::size_t kMostParts = 16;

  // An element that rays may meet.
  struct Part {
    std::size_t element;      // of the solid
    std::size_t first, last;  // in leaves_; equal: the whole element
  };

  void add_element(std::size_t index, const Eigen::AlignedBox3d& directions_L, double max_t);
  void cast_part(const Part& part, std::uint32_t rays, const std::array<double, kRays>& limit,
                 std::array<RayHit, kRays>* hits) const;

  const Solid* solid_ = nullptr;
  Eigen::Vector3d origin_L_ = Eigen::Vector3d::Zero();
  Directions directions_L_;
  std::array<Part, kMostParts> parts_;
  std::size_t part_count_ = 0, leaf_count_ = 0;
  std::array<TriangleBvh::RayLeaf, kMostLeaves> leaves_;
  bool is_whole_ = false;  // too many elements: each ray is cast against the solid
};

}  // namespace ist
