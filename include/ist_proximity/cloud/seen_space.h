#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "ist_proximity/cloud/memory_map.h"

namespace ist {

/// The space that any of several memories knows, be it free or occupied; the rest is unknown space.
/// All memories have the same frame M and resolution. Copies share nothing. Reading is thread safe.
class SeenSpace {
 public:
  SeenSpace();
  ~SeenSpace();
  SeenSpace(SeenSpace&&) noexcept;
  SeenSpace& operator=(SeenSpace&&) noexcept;

  /// Adds what a memory knows.
  /// @throws std::invalid_argument when its resolution is another one than that of the first
  void add(const MemoryMap& map);

  /// [s] When the block of 8 x 8 x 8 voxels about a point was last measured; NaN: the voxel of the
  /// point is unknown.
  double time_seen(const Eigen::Vector3d& p_M) const;

  /// The unknown space within a sphere, as boxes of whole voxels that lie in blocks of 8 x 8 x 8
  /// voxels which the sphere touches. Space that no voxel has a key for (32768 voxels from the
  /// origin, along any axis) is unknown. Nothing is known as long as no memory is added; there are
  /// no boxes then.
  /// @param max_boxes  no more are made
  /// @param boxes      [m] in M, overwritten
  /// @returns whether all are there
  bool unknown_boxes(const Eigen::Vector3d& center_M, double radius, std::size_t max_boxes,
                     VoxelBoxes* boxes) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace ist
