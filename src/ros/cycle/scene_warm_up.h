#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "internal/repulsion/coherent_queries.h"
#include "ros/input/source.h"

namespace ist {

/// The question of a cycle.
struct AskedScene {
  SnapshotRequest request;
  std::vector<int> sources;             ///< of the clouds, in their order
  std::vector<Eigen::Isometry3d> X_FL;  ///< by link of the robot
  std::vector<bool> known;              ///< the same
  QueryConfig query;
  RepulsionConfig repulsion;
};

/// Keeps the first answer with a new cloud out of the cycle: before a source hands on a snapshot,
/// its thread answers with it what the cycle asked last, and the cycle goes on from there.
///
/// There are two CoherentQueries: the cycle's own, and a spare one. A source's thread takes the
/// spare one while it works, and the cycle exchanges the two when its clouds are those that the
/// spare one is warm for. The cycle never waits: where the lock is taken, or the spare one is in
/// use, its own goes on, with an answer that is as slow and as right as without a warm-up.
class SceneWarmUp {
 public:
  /// @param sources  outlives this; it is filled before the first note()
  explicit SceneWarmUp(const CloudSources& sources) : sources_(sources) {}

  /// Sets the spare queries of a model; null: there is nothing to warm up. The cycle's thread only.
  void begin(std::unique_ptr<CoherentQueries> spare);

  /// Takes the scene of a cycle, where the lock is free. The cycle's thread only.
  void note(const AskedScene& scene);

  /// Exchanges the cycle's queries for the spare ones, if those are warm for its clouds. The
  /// cycle's thread only.
  /// @param obstacles  key of the clouds, see obstacles_key()
  /// @returns whether they were
  bool exchange(std::uint64_t obstacles, std::unique_ptr<CoherentQueries>* own);

  /// Warms up the spare queries for the last scene with a new snapshot. Nothing is done where the
  /// source's last one was not part of the scene, or another source is at it. Thread safe.
  /// @param fresh  not handed on yet
  /// @returns [s] what it took
  double run(const ObstacleSource& source, const SourceSnapshot& fresh);

  /// Waits until no thread is in run(); it does nothing from now on. Thread safe.
  void end();

 private:
  bool select_clouds(const ObstacleSource& source, const SourceSnapshot& fresh);

  const CloudSources& sources_;

  std::mutex mutex_;  ///< held for moves and copies only; guards the members below
  std::unique_ptr<CoherentQueries> spare_;
  std::uint64_t spare_obstacles_ = 0;  ///< key of the clouds that it is warm for; 0: none
  AskedScene newest_;
  std::uint64_t generation_ = 0;  ///< counts begin()
  bool has_scene_ = false, has_ended_ = false;

  std::mutex run_mutex_;  ///< of the one thread that warms up; guards the members below
  AskedScene scene_;
  std::vector<std::shared_ptr<const SourceSnapshot>> held_;
  std::vector<const CloudSnapshot*> clouds_;
};

}  // namespace ist
