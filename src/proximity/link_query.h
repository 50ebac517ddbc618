#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <limits>
#include <vector>

#include "ist_proximity/proximity/proximity_query.h"
#include "proximity/carried_bound.h"
#include "proximity/depth_grid.h"
#include "proximity/front.h"
#include "proximity/known_distances.h"
#include "proximity/traversal.h"

namespace ist {

/// When a query has to end.
class Deadline {
 public:
  explicit Deadline(double seconds);
  bool passed();  ///< once true, always true

 private:
  std::chrono::steady_clock::time_point end_;
  bool limited_;
  bool passed_ = false;
};

/// The query of one link: warm start, descent against every cloud and map, exact refinement, depth.
class LinkQuery {
 public:
  explicit LinkQuery(const LinkModel& link)
      : link_(&link), carried_(link), extent_(link), grid_(link), supports_(link.tree) {}

  /// Sets the pose and evaluates the last answer's point at it, if that point is still there.
  /// @param seen  by SeenClouds: whether bounds of other poses hold
  void start(const Eigen::Isometry3d& X_FL, SnapshotSpan clouds, std::uint64_t seen,
             const QueryConfig& config);

  /// As start(), without the last answer's point: for a link that need only be known where it is
  /// nearer than another.
  /// @param nearest  [m] that another link is known to be at
  void start_cold(const Eigen::Isometry3d& X_FL, std::uint64_t seen, const QueryConfig& config,
                  double nearest);

  /// [m] of the nearest point found; inf: none.
  double distance() const { return nearest_.exact.distance; }
  /// [m] Proven: the link's distance is not below it. Inf where nothing is in range.
  double proven() const;
  /// After refine(): whether the clouds end nowhere that this link would have to know.
  bool sees_all() const { return region_ >= config_.max_distance + config_.margin; }

  /// The descent. False: the deadline passed first; what is known by then still holds.
  bool refine(SnapshotSpan clouds, Deadline* deadline, QueryStatistics* statistics);

  /// The answer as it stands after start() or refine().
  void answer(SnapshotSpan clouds, LinkProximity* result);

  void forget() {
    last_build_id_ = 0;
    carried_.forget();
    fronts_.forget();
  }

 private:
  /// Which of a snapshot's indices is at work.
  enum class Part { kPoints, kBoxes };

  struct Nearest {
    SignedDistance exact;                           ///< in the link's frame
    Eigen::Vector3d p_L = Eigen::Vector3d::Zero();  ///< the obstacle point, in the link's frame
    Eigen::Vector3d p_F = Eigen::Vector3d::Zero();  ///< the same in the fixed frame
    std::int32_t cloud = -1, tile = 0;
    int lane = 0;
    Part part = Part::kPoints;
  };

  /// [m] More than double loses where distances are compared.
  static constexpr double kRounding = 1e-12;
  static double a_little_more(double distance) { return (1.0 + 1e-9) * distance + kRounding; }

  bool is_settled();
  void look_ahead();
  void keep_bound();
  static std::uint64_t build_id(const CloudSnapshot& cloud, Part part);
  static std::uint32_t key_of(std::int32_t tile, int lane) {
    return static_cast<std::uint32_t>(tile) * kPointWidth + static_cast<std::uint32_t>(lane);
  }
  bool enter(const CloudSnapshot& cloud, std::int32_t index, Part part);
  Eigen::Vector3d point_O(std::int32_t tile, int lane) const;
  /// @param below   [m] what the point's distance is known to be below, or else does not matter
  /// @param toward  unit, about the way from the surface to the point, link frame
  void consider(std::int32_t tile, int lane, bool is_outside, double below,
                const Eigen::Vector3d& toward);
  void take(const SignedDistance& exact, const Eigen::Vector3d& p_L, const Eigen::Vector3d& p_O,
            std::int32_t tile, int lane);
  bool search(Deadline* deadline);
  Traversal make_traversal();
  void go_on(Traversal* traversal);
  bool needs_aim() const;
  void aim_later(Traversal* traversal) const;
  void set_planes(Traversal* traversal) const;
  static void on_aim(void* context);
  static void on_nearer(void* context);
  void descend(Traversal* traversal);
  void find_first(Traversal* traversal);
  void find_depth(Deadline* deadline);
  double depth_bound(const Eigen::Vector3d& center, double radius);
  /// [m] What is farther from the spheres is outside.
  double interior_reach() const { return link_->tree.interior_gap() + 3.0 * rounding_; }
  void find_depth_in_tile(std::int32_t tile, double tile_bound);

  // Of points that wait, in link_waiting.cpp.
  /// What became of a point in this descent.
  struct Visit {
    std::uint32_t epoch = 0, key = 0;
    std::int32_t waiting = -1;  ///< index in `waiting_`; -1: it is done with
  };
  Visit& visit_of(std::uint32_t key) { return visited_[(key * 2654435761U) >> 23U]; }
  bool is_visited(const Visit& visit, std::uint32_t key) const {
    return visit.epoch == epoch_ && visit.key == key;
  }
  bool first_visit(std::int32_t tile, int lane);
  static void on_candidate(void* context, std::int32_t tile, int lane, float bound);
  void keep_promise();
  Eigen::Vector3d way_from_sphere(std::int32_t leaf, const Eigen::Vector3d& p_L) const;
  void evaluate_waiting();
  void drop_far_waiting();
  void rule_out_waiting();

  // Of boxes, in link_boxes.cpp.
  double depth_threshold() const;
  static constexpr int kMaxCells = 256;  ///< a link may divide overlapping boxes into
  struct BoxCell;
  void consider_box(std::int32_t tile, int lane, bool is_outside);
  void take_outside(const BoxDistance& found, std::int32_t tile, int lane);
  void take_point(const Eigen::Vector3d& p_O, std::int32_t tile, int lane);
  void take_overlap(const BoxDistance& found, const Eigen::AlignedBox3d& box, std::int32_t tile,
                    int lane);
  void take_sphere(std::int32_t leaf, std::int32_t tile, int lane);
  void find_overlap(Deadline* deadline);
  void find_overlap_in_tile(std::int32_t tile);
  void find_depth_in_box(const BoxCell& whole, std::int32_t tile, int lane);
  BoxCell make_cell(const Eigen::AlignedBox3d& box, std::int32_t tile, int lane);
  double to_region(const RegionOfInterest& region) const;
  void drop(double bound) { dropped_ = std::min(dropped_, bound); }
  double least_bound() const { return std::min({nearest_.exact.distance, evaluated_, dropped_}); }
  double range() const { return config_.max_distance + config_.margin + rounding_; }
  double wanted_below(double distance) const;
  /// [m] bounds from here on cannot change the answer by more than the tolerance.
  double threshold() const;
  static bool on_expired(void* context);

  const LinkModel* link_;
  QueryConfig config_;
  Eigen::Isometry3d X_FL_ = Eigen::Isometry3d::Identity();
  Nearest nearest_;
  double dropped_ = 0.0;    ///< [m] smallest bound of all that was not evaluated
  double evaluated_ = 0.0;  ///< [m] and of what was, but not to the last
  double rounding_ = 0.0;   ///< [m] largest error of a float bound
  double others_ = 0.0;     ///< [m] distance of other links, that this one need not be beyond
  double reach_ = 0.0;      ///< [m] largest coordinate of the link in the index's frame
  double region_ = 0.0;     ///< [m] no point that the clouds left out is nearer
  bool complete_ = false;

  CarriedBound carried_;
  LinkExtent extent_;
  Fronts fronts_;
  KnownDistances known_;
  DepthGrid grid_;
  std::uint64_t seen_ = 0;     ///< clouds, by SeenClouds
  double beyond_ = 0.0;        ///< [m] smallest bound of a point, by the spheres alone
  double proven_reach_ = 0.0;  ///< [m] `reach_` where the carried bound was proven

  // The index at work, in a frame O of its own.
  const PointBvh* index_ = nullptr;
  const BoxBvh* boxes_ = nullptr;
  std::int32_t cloud_ = -1;
  Eigen::Isometry3d X_FO_ = Eigen::Isometry3d::Identity();
  Eigen::Isometry3d X_LO_ = Eigen::Isometry3d::Identity();
  Eigen::Isometry3d X_OL_ = Eigen::Isometry3d::Identity();
  int cells_left_ = 0;  ///< that overlapping boxes may still be divided into
  Traversal* traversal_ = nullptr;
  Deadline* deadline_ = nullptr;
  QueryStatistics* statistics_ = nullptr;

  // The last answer's point, for the next warm start.
  std::uint64_t last_build_id_ = 0;
  std::int32_t last_tile_ = 0;
  int last_lane_ = 0;
  Eigen::Vector3d last_witness_L_ = Eigen::Vector3d::Zero();

  // How far the link's parts reach toward the nearest point.
  Supports supports_;
  Eigen::Vector3d aim_L_ = Eigen::Vector3d::Zero();  ///< direction, in the link's frame

  // Points or boxes evaluated in this descent: several sphere leaves meet the same one.
  static constexpr std::size_t kVisitedSize = 512;
  std::array<Visit, kVisitedSize> visited_{};
  std::uint32_t epoch_ = 0;

  // Points that may be nearest: they wait until the descent knows better which one.
  struct Waiting {
    float bound;  ///< [m]
    std::int32_t tile;
    int lane;
  };
  static constexpr std::size_t kMaxWaiting = 64;
  std::array<Waiting, kMaxWaiting> waiting_;
  std::size_t waiting_count_ = 0;

  /// [m] What inner spheres promise: the traversal's `inner` point is no farther. Where the mesh
  /// has holes that may not be so; then the descent is made again without. Inf: nothing is
  /// promised.
  double promised_ = 0.0;
  bool is_broken_ = false;
};

}  // namespace ist
