#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include "ist_proximity/proximity/world_query.h"
#include "proximity/link_pair_query.h"
#include "proximity/posed_objects.h"
#include "proximity/robot_surfaces.h"
#include "proximity/world_shape.h"

namespace ist {

/// The question to one link.
struct ObjectQuestion {
  QueryConfig config;
  double link_margin = 0.0;         ///< [m]
  double influence_distance = 0.0;  ///< [m]
};

/// The search for the objects nearest to one link. Nothing is allocated but by prepare().
class ObjectSearch {
 public:
  /// Measured objects whose searches are kept.
  static constexpr std::size_t kSlots = 24;

  /// @param robot  outlives this
  ObjectSearch(const RobotSurfaces& robot, std::size_t link);

  /// Makes memory for these objects.
  /// @param open  null, or a shape with holes among them
  void prepare(std::size_t objects, const WorldShape* open);

  /// Begins a query: bounds by boxes, and the distance to one object.
  /// @param objects  outlive the query; those are placed that are near
  void begin(const Eigen::Isometry3d& X_FL, PosedObjects* objects, const ObjectQuestion& question,
             WorldQueryStatistics* statistics);
  /// The link is UNKNOWN.
  void begin_unknown();
  /// Goes on until the tolerance is reached.
  /// @returns false when the steps were used up first
  bool advance(int steps);
  /// [m] What is proven so far, margins taken off.
  double lower_bound() const;
  bool is_finished() const { return is_finished_; }
  /// Ends the query.
  void report(LinkProximity* result);
  const std::vector<NearObject>& near() const { return near_; }

 private:
  struct Candidate {
    double bound;  ///< [m] by boxes, margins taken off; -inf: none
    std::uint32_t object;
    bool operator<(const Candidate& other) const { return bound > other.bound; }  ///< least on top
  };
  struct Slot {
    std::uint64_t id = 0;  ///< of the object; 0: none
    std::shared_ptr<const WorldShape> shape;
    std::optional<LinkPairQuery> query;
    std::uint64_t used = 0;  ///< number of the last query
  };

  /// @tparam Posed  PosedObject or ObjectGroup
  template <class Posed>
  double less_errors(double bound, const Posed& posed, double drift) const;
  double box_bound(const PosedObject& object) const;
  double margin_of(const PosedObject& object) const;
  double stop_bound() const;
  void list_objects();
  void collect_candidates();
  void activate(const Candidate& candidate);
  Slot* slot_of(const PosedObject& object);
  void take_result();
  void take_distance(const PairProximity& found);
  LinkProximity answer_of(const PairProximity& found, const PosedObject& object) const;

  const LinkModel& model_;
  const LinkSurface* surface_;  // null: the link is not usable
  Eigen::Vector3d center_L_, half_L_;
  double radius_ = 0.0, extent_ = 0.0;  // [m] of the sphere about the box; from L's origin

  // The list of objects that may come into range.
  std::vector<std::uint32_t> list_;
  Eigen::Isometry3d X_FL_of_list_ = Eigen::Isometry3d::Identity();
  double path_of_list_ = 0.0, range_of_list_ = -1.0;
  std::uint64_t generation_of_list_ = 0;

  std::vector<Slot> slots_;
  bool slots_are_open_ = false;
  std::uint64_t queries_ = 0;
  std::uint64_t nearest_id_ = 0;  // of the last query

  // One query.
  PosedObjects* objects_ = nullptr;
  ObjectQuestion question_;
  WorldQueryStatistics* statistics_ = nullptr;
  RigidPose X_FL_;
  Eigen::Vector3d center_F_;
  std::vector<Candidate> candidates_;  // a heap
  Slot* current_ = nullptr;            // the pair that is being measured
  Candidate current_candidate_{};
  double current_range_ = 0.0;  // [m] bound of a pair that is CLEAR
  bool is_known_ = false, is_finished_ = true;
  double proven_ = 0.0;  // [m] of the pairs that are measured
  double distance_ = std::numeric_limits<double>::infinity();
  LinkProximity nearest_;
  std::vector<NearObject> near_;
};

}  // namespace ist
