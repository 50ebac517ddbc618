#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <chrono>
#include <cstdint>
#include <memory>
#include <vector>

#include "ist_proximity/cloud/cloud_snapshot.h"
#include "ist_proximity/robot/robot_model.h"

namespace ist {

/// An instant at which a computation ends, whatever is left to do; max(): never.
using TimePoint = std::chrono::steady_clock::time_point;

/// How a query answers.
struct QueryConfig {
  /// [m] a link without an obstacle nearer than this is CLEAR; > 0. More than 1e9, also +inf,
  /// counts as 1e9.
  double max_distance = 1.0;
  /// [m] largest `distance - lower_bound`; 0 asks for the exact distance. >= 0.
  double tolerance = 0.001;
  /// [s] from the start of run(); 0: none. A query that it stops returns bounds that hold. Links
  /// that nothing is known of yet may exceed it by 50 us together.
  double deadline = 0.0;
  /// [m] >= 0, subtracted from every lower bound to allow for sensor noise, calibration, latency.
  /// More than 1e9 counts as 1e9.
  double margin = 0.0;
  /// The tolerance as a ratio to the distance, used where that is wider than `tolerance`; 0 to 1.
  double relative_tolerance = 0.0;
};

/// State of knowledge about a distance. UNKNOWN: no pose, no geometry, no cloud, the deadline
/// passed before anything was proven, or a map's box may be inside through the opening of a mesh.
/// CLEAR: nothing is within max_distance. NEAR: the distance is from 0 to max_distance. CONTACT:
/// the distance is below 0.
enum class LinkState : std::uint8_t { kUnknown = 0, kClear = 1, kNear = 2, kContact = 3 };

/// Answer for one link; vectors and points in the fixed frame F unless said.
struct LinkProximity {
  LinkState state = LinkState::kUnknown;  ///< decides which of the other members are valid
  double distance;  ///< [m] signed, upper bound; +inf when CLEAR, NaN when UNKNOWN
  /// [m] Proven; max_distance when CLEAR, -inf when UNKNOWN. Where points have an extent
  /// (PointExtent), it is that of their spheres. It may be negative in NEAR then, and where a map's
  /// box may be inside through the opening of a mesh.
  double lower_bound;
  Eigen::Vector3d p_FCl;  ///< [m] closest point on the link; NaN unless NEAR or CONTACT
  Eigen::Vector3d p_LCl;  ///< [m] the same in the link's own frame
  Eigen::Vector3d p_FCo;  ///< [m] closest point on the obstacle
  /// Unit vector along which the link moves away: p_FCl - p_FCo = distance * direction.
  Eigen::Vector3d direction;
  /// [m] The part of distance - lower_bound that is the points' extent; 0 where they have none.
  double sensor_width;
  /// [m] The part that is QueryConfig::margin. What remains is the tolerance, and rounding.
  double margin;
  std::int32_t source = -1;  ///< index of the snapshot that holds the nearest point
  std::uint32_t point = 0;   ///< id of that point in its message

  LinkProximity() { reset(); }
  void reset();  ///< to UNKNOWN
};

/// Answer for the whole robot: its nearest link.
struct RobotProximity {
  std::int32_t link = -1;  ///< the link that `nearest` belongs to; -1 when UNKNOWN or CLEAR
  /// The answer of the nearest link that is known. Its `lower_bound` is proven for every link; it
  /// is -inf where a link is not known, and then no robot is CLEAR.
  LinkProximity nearest;
  bool all_known = false;  ///< false: links have no pose or no geometry
};

/// Counts of a query's work, for tuning and tests.
struct QueryStatistics {
  std::uint64_t node_pairs = 0;         ///< nodes of hierarchies of obstacles that were expanded
  std::uint64_t leaf_pairs = 0;         ///< tiles of obstacles that were looked at
  std::uint64_t exact_evaluations = 0;  ///< points measured against the link's exact geometry
  std::uint64_t outside_region = 0;     ///< links whose range ends outside a cloud's region
  std::uint64_t unfinished = 0;         ///< links that a deadline left wider than the tolerance
  /// [m] Largest distance - lower_bound, margin aside, of the unfinished links whose state is
  /// known.
  double widest = 0.0;
};

/// Distances from the links of a robot to point clouds.
///
/// Branch and bound over the hierarchies of clouds and maps, best first: boxes are bounded by the
/// link's distance field (LinkModel::field), or where it has none by the cover spheres of its Inner
/// Sphere Tree; obstacles that remain are measured against the exact geometry until `tolerance` is
/// met, so `distance` is exactly that of one obstacle point. Bounds are signed, so contact and
/// depth are the same search.
///
/// A query that has a deadline first measures one obstacle for every link and proves which links
/// are free; then it asks every link to within half of its distance, and then to within the
/// tolerance, the link that may be nearest first.
///
/// Queries allocate nothing, lock nothing and never throw; one object per thread. The last answer
/// gives the next query its first upper bound (warm start). While the snapshots stay the same,
/// lower bounds that are proven at one pose hold at the next one, less the displacement bound
/// (temporal coherence). Neither changes the bounds and states that an answer guarantees, and poses
/// may jump. But what a query remembers decides where it stops: two answers to one question may
/// differ within the tolerance, each with a proven bound. At tolerance 0 both distances are the
/// true one.
///
/// Working memory is about 90 kB a link for the parts of clouds and maps that the last searches
/// have pruned, and 33 kB more for a mesh with holes.
class ProximityQuery {
 public:
  /// @param model  shared with the caller; not null
  ProximityQuery(std::shared_ptr<const RobotModel> model, const QueryConfig& config);
  ~ProximityQuery();
  ProximityQuery(ProximityQuery&&) noexcept;
  ProximityQuery& operator=(ProximityQuery&&) noexcept;

  /// @param X_FL    by link: link frame -> fixed frame, rigid to 1e-6 (see is_rigid); ignored
  ///                where `known` is false. NaN or infinity make the link UNKNOWN
  /// @param known   by link: false makes the link UNKNOWN. Where it or X_FL has another size than
  ///                the model's links, every link is UNKNOWN
  /// @param clouds  the snapshots of all usable sources; none makes every link UNKNOWN
  /// @param results one per link, overwritten
  /// @returns false when the deadline passed before every link met its tolerance
  bool run(Span<const Eigen::Isometry3d> X_FL, const std::vector<bool>& known, SnapshotSpan clouds,
           std::vector<LinkProximity>* results);

  /// The robot's minimum only. The links share one upper bound, so it is several times faster.
  /// @param result  overwritten; UNKNOWN when no link is known or no cloud is given, and where a
  ///                link is not known and nothing is in range of the others
  /// @returns as run()
  bool run_minimum(Span<const Eigen::Isometry3d> X_FL, const std::vector<bool>& known,
                   SnapshotSpan clouds, RobotProximity* result);

  /// One link only.
  /// @param link  index in the model; UNKNOWN when there is none
  /// @returns as run()
  bool run_link(std::size_t link, const Eigen::Isometry3d& X_FL, SnapshotSpan clouds,
                LinkProximity* result);

  /// Takes a model that differs from the present one in packings alone (see same_geometry()).
  /// Whatever was proven or measured stays: bounds, fronts, the answer to start from.
  void set_model(std::shared_ptr<const RobotModel> model);

  /// Takes effect at the next run().
  void set_config(const QueryConfig& config);
  const QueryConfig& config() const;          ///< settings of the next run()
  const QueryStatistics& statistics() const;  ///< of the last run()
  const RobotModel& model() const;            ///< the one given to the constructor
  std::size_t memory() const;                 ///< [bytes] of its working memory, without the model

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Whether X is a rotation and a translation to within `tolerance`, and finite.
bool is_rigid(const Eigen::Isometry3d& X, double tolerance = 1e-6);

}  // namespace ist
