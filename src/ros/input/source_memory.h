#pragma once

#include <ros/publisher.h>
#include <ros/time.h>

#include <limits>
#include <memory>
#include <mutex>
#include <string>

#include "ist_proximity/cloud/memory_map.h"
#include "ist_proximity/cloud/seen_space.h"
#include "ros/input/measurement.h"
#include "ros/input/source.h"
#include "ros/parameters/source_config.h"

namespace ist {

/// What a memory knows beside its voxels.
struct KnownSpace {
  VoxelBoxes links;    ///< [m] each holds a link as it was last noted, in the fixed frame
  double stamp = 0.0;  ///< [s] of the last cloud
  std::string frame;   ///< the fixed frame's name
  std::shared_ptr<const RobotModel> robot;  ///< whose own space is known
};

/// The memory of one source (~memory) in the fixed frame: its clouds go into a MemoryMap in the
/// source's thread, before they are handed to queries, so that a cloud and what is hidden from it
/// always belong together.
///
/// For queries it is a source of its own, NAME/memory. Beside a fresh cloud its snapshots come with
/// those of its parent (see CloudSelection), else they are its own.
class SourceMemory : public ObstacleSource {
 public:
  /// @param config     its memory is enabled
  /// @param wants_body  whether the space that the robot takes up has to be known (~unknown_space)
  /// @param buffer      outlives this
  SourceMemory(const SourceConfig& config, bool wants_body, const TransformBuffer& buffer,
               const ros::Publisher& publisher);

  bool is_memory() const override { return true; }

  // The source's thread only.

  /// Takes another fixed frame, clock or robot. When the clock is set back, obstacles stay, and
  /// keep their age; free space stays where the clock went back by less than a second. What lies in
  /// another frame is lost. Where another robot was, for example with an object that it has let go
  /// of, anything may be.
  void begin_target(const SourceTarget& target);

  /// Takes a cloud that has just been ingested.
  /// @returns what is hidden from the cloud: boxes at the cloud's stamp; null: nothing is
  /// remembered yet
  std::shared_ptr<const SourceSnapshot> take(const Measurement& measurement,
                                             const Placement& placement, const SourceTarget& target,
                                             const SourceSnapshot& cloud);

  /// Makes newest() again once in a while, as nobody else does while no cloud comes.
  void grow_older();

  /// All that is remembered, in view or not: what is known of obstacles while there is no fresh
  /// cloud. Null: nothing, or the source is required, so that nothing is known then. It stays valid
  /// until the next call and never waits. The cycle's thread only.
  const SourceSnapshot* newest(const SnapshotRequest& request) override;

  // Thread safe. What is told waits for no cloud.

  /// The same for any other thread; valid as long as it is held.
  std::shared_ptr<const SourceSnapshot> share(const SnapshotRequest& request) override;
  /// What it has lost of obstacles that it would still remember, as a sentence; empty: nothing.
  std::string loss() const;

  void report(SourceReport* report) override;
  /// Writes ~memory/file, but never over a file that has not been read, or could not be.
  /// @returns a sentence
  std::string save(bool* is_saved);
  /// Adds what is known now, the robot's own space included, and forgets what is too old.
  /// @returns false: nothing is known yet
  bool add_to(SeenSpace* seen, KnownSpace* known);
  /// [m] Space nearer to a link than this counts as the robot's own.
  double skin() const;

  /// [s] after which what was measured is forgotten; may be inf.
  double decay() const { return config_.memory.map.decay; }
  const SourceConfig& config() const { return config_; }

 private:
  struct Told {
    std::string problem, doubt;
    std::string loss;         ///< empty: nothing has been lost
    double lost_until = 0.0;  ///< [s] when what was lost would have been forgotten
    MemoryCounts counts;
    std::shared_ptr<const SourceSnapshot> all;  ///< see share()
  };

  std::string insert(const Measurement& measurement, const Placement& placement,
                     const SourceTarget& target, const SourceSnapshot& cloud);
  void change_frame(const std::string& before);
  void lose_all(const std::string& reason);
  void note_calibration(const SourceSnapshot& cloud);
  void set_back(double step);
  void read_file();
  void note_loss(const std::string& text);
  void hand_over();
  void note_region(const RegionOfInterest& region, double stamp);
  void note_extent(double extent, double stamp);
  void note_body(const Placement& placement, double stamp);
  double skin_of(double padding) const;
  void forget_body();
  std::shared_ptr<const SourceSnapshot> make_snapshot(void (MemoryMap::*find_boxes)(VoxelBoxes*)
                                                          const) const;
  void publish_when_due(const ros::Time& stamp);
  std::string shortage() const;
  std::string advice() const;

  static constexpr double kNever = -std::numeric_limits<double>::infinity();

  const SourceConfig config_;
  const TransformBuffer& buffer_;
  const bool wants_body_;
  ros::Publisher publisher_;

  // Used by the source's thread alone.
  MemoryScan scan_;
  std::uint64_t generation_ = 0;
  double set_back_ = 0.0;  ///< [s] SourceTarget::set_back
  std::string fixed_frame_;
  std::string sensor_frame_;          ///< of the last cloud,
  std::uint64_t static_changes_ = 0;  ///< which was placed after so many static changes
  std::shared_ptr<const RobotModel> robot_;
  RegionOfInterest region_;  ///< in which all is remembered that has been seen
  RegionOfInterest newest_region_;
  double region_since_ = kNever;         ///< [s] the newest one is in use; kNever: there is none
  double body_noted_ = 0.0;              ///< [s]
  std::size_t lost_ = 0;                 ///< MemoryCounts::lost, as told
  ros::Time cloud_stamp_, counts_from_;  ///< of the last cloud
  double extent_ = 0.0;                  ///< [m] of points in voxels, the largest
  double later_extent_ = 0.0;            ///< [m] the largest of later clouds than that one's
  double extent_since_ = kNever;         ///< [s] stamp of the last cloud that had it
  std::chrono::steady_clock::time_point next_publication_, next_count_, next_growth_;

  mutable std::mutex mutex_;  ///< guards the members below
  MemoryMap map_, body_;
  VoxelBoxes links_;    ///< [m] each holds a link
  double stamp_ = 0.0;  ///< [s] of the last cloud
  std::string file_problem_;
  bool is_file_read_ = false;  ///< or there was none
  Told told_next_;
  double took_ = 0.0;  ///< [s] of the last cloud

  SharedChannel<const Told> told_;
};

/// The memories of all sources that have one.
using SourceMemories = std::vector<std::shared_ptr<SourceMemory>>;

}  // namespace ist
