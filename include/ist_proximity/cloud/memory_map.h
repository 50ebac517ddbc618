#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/cloud/octree.h"
#include "ist_proximity/geometry/region_of_interest.h"
#include "ist_proximity/geometry/span.h"

namespace ist {

class VoxelMap;

/// How a MemoryMap remembers.
struct MemoryConfig {
  double decay = 10.0;       ///< [s] > 0, may be inf: what was measured longer ago is forgotten
  double resolution = 0.02;  ///< [m] edge of a voxel; 0.001 to 1
  /// Voxels that there is memory for, >= 4096; 8.6 bytes each. What was measured longest ago is
  /// forgotten to stay below.
  std::size_t max_nodes = 8000000;
  double max_range =
      5.0;  ///< [m] > 0: rays are cut off there; farther points clear, and hit nothing
  /// One ray for each voxel that holds points, to its centre, as octomap's `discretize`: ten times
  /// as fast as a ray for each point.
  bool discretize = true;
  double hit = 0.7;           ///< probability that a hit voxel is occupied; 0.5 to 1 (octomap's)
  double miss = 0.4;          ///< probability that a voxel on a ray is occupied; 0 to 0.5
  double clamp_min = 0.1192;  ///< probabilities never go below; 0 to 0.5
  double clamp_max = 0.971;   ///< probabilities never go above; 0.5 to 1
};

/// The occupied and free space of one cloud, in the map's frame M. Points are finite.
struct MemoryScan {
  Eigen::Vector3f origin = Eigen::Vector3f::Zero();  ///< [m] the sensor
  std::vector<Eigen::Vector3f>
      hits;  ///< [m] obstacles: space is free up to them, and occupied there
  /// [m] Ends of rays that are free up to there, and of which nothing is known from there on:
  /// points on the robot.
  std::vector<Eigen::Vector3f> free_ends;
  double stamp = 0.0;  ///< [s]
};

/// State of knowledge of a voxel.
enum class VoxelState : std::uint8_t { kUnknown = 0, kFree = 1, kOccupied = 2 };

/// Numbers about a MemoryMap.
struct MemoryCounts {
  std::size_t known = 0;      ///< voxels known, occupied ones included
  std::size_t occupied = 0;   ///< voxels occupied
  std::size_t nodes = 0;      ///< voxels that memory is in use for
  std::size_t forgotten = 0;  ///< voxels forgotten for want of memory, since the start
  std::size_t skipped = 0;    ///< voxels of the last cloud for which there was no memory
  std::size_t lost =
      0;  ///< occupied ones of both kinds, since the start: obstacles, unless in view
};

/// Boxes of one or several whole voxels [m].
using VoxelBoxes = std::vector<Eigen::AlignedBox3d>;

/// A probabilistic occupancy map of what was seen, voxel by voxel, as octomap::OcTree holds it
/// (Hornung et al. 2013): the same keys, rays (Amanatides and Woo 1987), log-odds and clamping, so
/// that insert() of hits leaves exactly what OcTree::insertPointCloud() leaves. Voxels are kept in
/// blocks of 8 x 8 x 8 in a hash table, which takes a tenth of the time of an octree. Each voxel
/// knows when it was measured, and is forgotten after `decay`.
///
/// A voxel becomes free on a ray and occupied at its end; one that is both in the same cloud is
/// occupied. Not thread safe.
class MemoryMap {
 public:
  /// @throws std::invalid_argument naming the member and its value, when one is out of its range
  explicit MemoryMap(const MemoryConfig& config);
  ~MemoryMap();
  MemoryMap(MemoryMap&&) noexcept;
  MemoryMap& operator=(MemoryMap&&) noexcept;

  const MemoryConfig& config() const;  ///< the one given to the constructor

  /// Voxels outside the cube about the region are not remembered, from the next cloud on.
  /// @param region_M  in the map's frame; infinite: none
  void set_region(const RegionOfInterest& region_M);

  /// Takes a cloud. Times go on: a stamp before the last one counts as the last one.
  /// @throws std::invalid_argument when the origin is not finite
  void insert(const MemoryScan& scan);

  /// Forgets what was measured more than `decay` before `now` [s].
  void forget(double now);

  /// Forgets everything.
  void clear();
  /// Forgets what is free.
  void clear_free();

  /// Moves all times [s], as the clock that they are of has been set: nothing gets older by it.
  void shift_times(double seconds);

  /// The state of the voxel that holds a point.
  VoxelState state(const Eigen::Vector3d& p_M) const;
  /// Log-odds of a voxel; NaN where it is unknown.
  float log_odds(const Eigen::Vector3d& p_M) const;

  /// The occupied voxels that the last cloud does not answer for, merged to larger boxes: what it
  /// neither hit nor saw through, and what does not lie within a voxel behind one of its points.
  void hidden_boxes(VoxelBoxes* boxes) const;
  /// All occupied voxels, merged to larger boxes.
  void occupied_boxes(VoxelBoxes* boxes) const;

  /// Notes that space is free now for another reason than a cloud: a robot's body is there, or has
  /// just been there. This is no more log-odds: the voxels are as free as can be.
  /// @param spheres  [m] centre in M and radius; voxels with their centre within
  void note_free(Span<const Eigen::Vector4f> spheres, double now);

  MemoryCounts counts() const;  ///< voxels at present
  std::size_t lost() const;     ///< MemoryCounts::lost, without counting the others
  bool has_obstacles() const;   ///< whether any voxel is occupied
  /// [s] of the last cloud or forget(); NaN: there was none.
  double now() const;

  /// The map as octomap writes it in binary (free and occupied only): octomap_msgs/Octomap's
  /// `data`.
  /// @param nodes  if not null, the number of nodes of the tree
  std::vector<std::uint8_t> octree_bytes(std::size_t* nodes = nullptr) const;
  /// Writes a `.bt` file, which octomap reads. The file is whole or not there.
  /// @returns an empty string, or one sentence that names the fault
  std::string write_file(const std::string& path) const;
  /// Becomes what a `.bt` or `.ot` file of the same resolution says, as measured at `now` [s]. It
  /// stays as it is where there is a fault.
  /// @returns an empty string, or one sentence that names the fault
  std::string read_file(const std::string& path, double now);

 private:
  friend const VoxelMap& voxels_of(const MemoryMap& map);

  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace ist
