#pragma once

#include <ros/time.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/cloud/cloud_snapshot.h"
#include "ist_proximity/proximity/closing_speed.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ros/cycle/place_motion.h"
#include "ros/input/source.h"
#include "ros/status/status.h"

namespace ist {

/// Takes the newest snapshot of each source and selects those that queries may use. One thread.
class CloudSelection {
 public:
  /// kOnly: the one thread that calls ObstacleSource::newest(); kOther: shares the snapshots with
  /// it.
  enum class Reader { kOnly, kOther };

  explicit CloudSelection(Reader reader) : reader_(reader) {}

  /// @param request  its time is that of the link poses
  /// @param status   receives the sources and their statuses
  void update(const ros::Time& now, const CloudSources& sources, const SnapshotRequest& request,
              StatusInput* status);

  /// Takes other poses of the same worlds.
  /// @param worlds  valid until the next update()
  void set_worlds(Span<const PosedWorld* const> worlds) {
    worlds_.assign(worlds.begin(), worlds.end());
  }

  // Results of the last update(), valid until the next one.

  /// The clouds that queries may use; empty while a required source is not usable.
  SnapshotSpan clouds() const { return clouds_; }
  /// The known worlds that queries may use, at their poses; as clouds().
  Span<const PosedWorld* const> worlds() const { return worlds_; }
  /// The surfaces of the robot's links; null where there is no world.
  const std::shared_ptr<const RobotSurfaces>& surfaces() const { return surfaces_; }
  /// By source: its snapshot where that is selected, else null.
  const std::vector<const SourceSnapshot*>& selected() const { return selected_; }
  /// The stamp of the oldest selected cloud, map files aside; zero when there is none.
  ros::Time oldest_stamp() const { return oldest_stamp_; }
  /// By cloud: the number of its source; the clouds of a source follow each other.
  const std::vector<int>& cloud_sources() const { return cloud_sources_; }
  /// The number of the source of the nearest point of an answer; -1: no point is near.
  /// @param is_world  whether that point is an object's
  int source_of(const LinkProximity& answer, bool is_world) const;
  /// The selected cloud that holds that point, where it is no object's.
  /// @param source  the number of its source
  ClosingSpeed::Nearest nearest(const LinkProximity& answer, int source) const;
  /// The zones that have left points out of the selected clouds, each once.
  void list_zones(std::vector<std::string>* names) const;
  /// Makes links false whose own points the self-filter left in a selected cloud: they would be
  /// found touching themselves.
  void exclude_unfiltered(std::vector<bool>* links) const;

 private:
  const SourceSnapshot* newest(const CloudSources& sources, std::size_t source,
                               const SnapshotRequest& request, const StatusInput& status);
  void take_obstacles(const StatusInput& status);
  bool stands_still(std::size_t source, const SourceReport& report);

  /// The motion of a source's obstacles.
  struct Motion {
    std::uint64_t cloud = 0;  ///< the last one's obstacles_key()
    PlaceMotion place;
  };

  const Reader reader_;
  std::vector<const SourceSnapshot*> selected_;
  std::vector<std::shared_ptr<const SourceSnapshot>> held_;  ///< used with Reader::kOther
  std::vector<const CloudSnapshot*> clouds_;
  std::vector<int> cloud_sources_;
  std::vector<bool> cloud_stands_still_;  ///< by cloud
  std::vector<Motion> motions_;           ///< by source
  double time_ = 0.0;                     ///< [s] of the link poses
  std::vector<const PosedWorld*> worlds_;
  std::vector<int> world_sources_;  ///< by world: the number of its source
  std::shared_ptr<const RobotSurfaces> surfaces_;
  ros::Time oldest_stamp_;
};

}  // namespace ist
