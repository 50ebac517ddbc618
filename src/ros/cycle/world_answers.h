#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <memory>
#include <vector>

#include "ist_proximity/proximity/closing_speed.h"
#include "ist_proximity/proximity/world_query.h"
#include "ros/cycle/cloud_selection.h"
#include "ros/cycle/late_frames.h"
#include "ros/cycle/place_motion.h"
#include "ros/status/status.h"

namespace ist {

/// The distances of one cycle to the known worlds, beside those to clouds. One thread.
class WorldAnswers {
 public:
  /// Measures the links against the worlds of a selection.
  /// @param time  [s] of the poses
  /// @param late  frames of the worlds; receives what it took off
  /// @param cost  links that `end` left unfinished are added
  void run(Span<const Eigen::Isometry3d> X_FL, const std::vector<bool>& known,
           const CloudSelection& selection, QueryConfig query, double influence_distance,
           double time, TimePoint end, LateFrames* late, DeadlineCost* cost);

  /// Takes the nearer of cloud and world for each link; the lower bound is that of both. A link
  /// that is UNKNOWN to either is UNKNOWN.
  /// @param clouds   the selected clouds; where there are none, the worlds alone decide
  /// @param results  by link: the answers of the clouds, overwritten
  void combine(SnapshotSpan clouds, std::vector<LinkProximity>* results);

  /// The surfaces of the robot's links that the last run() measured with; null before the first
  /// world.
  std::shared_ptr<const RobotSurfaces> surfaces() const {
    return query_ ? query_->robot() : nullptr;
  }

  /// Whether the nearest point of a link is an object's.
  bool is_nearest(std::size_t link) const { return is_nearest_[link]; }
  /// Whether there is a world.
  bool any() const { return any_; }
  bool is_in_contact(std::size_t link) const {
    return any_ && answers_[link].state == LinkState::kContact;
  }
  /// See WorldQuery::near_objects().
  Span<const NearObject> near_objects(std::size_t link) const {
    return any_ ? query_->near_objects(link) : Span<const NearObject>();
  }
  /// See WorldQuery::is_finished().
  bool is_finished(std::size_t link) const { return !any_ || query_->is_finished(link); }
  /// Another one whenever the objects are others, but not when they move with their frames; 0
  /// without a world.
  std::uint64_t key() const { return any_ ? key_ : 0; }
  /// The motion of the world that holds the nearest point of an answer, where that is an object's.
  /// @param source  the number of its source
  ClosingSpeed::Nearest nearest(const LinkProximity& answer, int source) const;

 private:
  /// The motion of a world's frames.
  struct Motion {
    PlaceMotion place;
    std::shared_ptr<const KnownWorld> world;
  };
  void note_motion(const CloudSelection& selection, double time);

  std::unique_ptr<WorldQuery> query_;  ///< null before the first world
  std::vector<LinkProximity> answers_;
  std::vector<bool> is_nearest_;
  std::vector<Motion> motions_;  ///< by world
  double time_ = 0.0;            ///< [s] of the last run()
  std::uint64_t key_ = 0;
  bool any_ = false;
};

}  // namespace ist
