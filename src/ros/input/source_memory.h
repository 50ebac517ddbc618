#pragma once

#include <ros/publisher.h>
#include <ros/time.h>

#include <memory>
#include <mutex>
#include <string>

#include "ist_proximity/cloud/memory_map.h"
#include "ist_proximity/cloud/seen_space.h"
#include "ros/input/measurement.h"
#include "ros/input/source_snapshot.h"
#include "ros/input/source_state.h"
#include "ros/parameters/source_config.h"
#include "ros/poses/transform_buffer.h"

namespace ist {

/// What a memory knows beside its voxels.
struct KnownSpace {
  VoxelBoxes links;    ///< [m] each holds a link as it was last noted, in the memory's frame M
  double stamp = 0.0;  ///< [s] of the last cloud
  std::string frame;   ///< tf's name of M
};

/// What one source remembers (~memory): its clouds go into a MemoryMap in the source's thread,
/// before they are handed to queries, so that a cloud and what is hidden from it always belong
/// together.
class SourceMemory {
 public:
  /// @param config     its memory is enabled
  /// @param buffer     outlives this
  /// @param wants_body  whether the space that the robot takes up has to be known (~unknown_space)
  SourceMemory(const SourceConfig& config, const TransformBuffer& buffer, bool wants_body,
               const ros::Publisher& publisher);

  /// Takes a cloud that has just been ingested. The source's thread only.
  /// @returns what is hidden from the cloud: boxes at the cloud's stamp; null: nothing is
  /// remembered yet
  std::shared_ptr<const SourceSnapshot> take(const Measurement& measurement,
                                             const Placement& placement, const SourceTarget& target,
                                             const SourceSnapshot& cloud);

  // Thread safe.

  /// Writes the state of the memory to the members of a report that are about it.
  void report(SourceReport* report) const;
  /// Writes ~memory/file, but never over a file that has not been read, or could not be.
  /// @returns a sentence
  std::string save(bool* is_saved);
  /// Adds what is known now, the robot's own space included, and forgets what is too old.
  /// @returns false: nothing is known yet
  bool add_to(SeenSpace* seen, KnownSpace* known);
  /// [m] Space nearer to a link than this counts as the robot's own.
  double skin() const;
  const SourceConfig& config() const { return config_; }

 private:
  std::string insert(const Measurement& measurement, const Placement& placement,
                     const SourceTarget& target, const SourceSnapshot& cloud);
  void begin_target(const SourceTarget& target);
  void note_body(const Placement& placement, const Eigen::Isometry3d& X_MF, double stamp);
  std::shared_ptr<const SourceSnapshot> make_snapshot(const SourceSnapshot& cloud,
                                                      void (MemoryMap::*find_boxes)(VoxelBoxes*)
                                                          const) const;
  void publish_when_due(const ros::Time& stamp);
  std::string shortage() const;
  std::string frame() const;

  const SourceConfig config_;
  const TransformBuffer& buffer_;
  const bool wants_body_;
  ros::Publisher publisher_;

  // Used by the source's thread alone.
  MemoryScan scan_;
  std::shared_ptr<const SourceSnapshot> newest_;
  std::uint64_t generation_ = 0;
  std::string fixed_frame_;
  double body_noted_ = 0.0;  ///< [s]
  std::chrono::steady_clock::time_point next_publication_, next_count_;

  mutable std::mutex mutex_;  ///< guards the members below
  MemoryMap map_, body_;
  Eigen::Isometry3d X_MF_ = Eigen::Isometry3d::Identity();
  VoxelBoxes links_;    ///< [m] each holds a link, in M
  double stamp_ = 0.0;  ///< [s] of the last cloud
  MemoryCounts counts_;
  std::string problem_, file_problem_;
  bool is_file_read_ = false;  ///< or there was none
  double took_ = 0.0;          ///< [s] of the last cloud
};

/// The memories of all sources that have one.
using SourceMemories = std::vector<std::shared_ptr<SourceMemory>>;

}  // namespace ist
