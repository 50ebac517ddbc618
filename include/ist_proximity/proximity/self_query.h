#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "ist_proximity/geometry/span.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/robot/kinematics.h"
#include "ist_proximity/robot/robot_model.h"

namespace ist {

/// Two links of a model, by index.
struct LinkPair {
  std::size_t first;   ///< index in the model
  std::size_t second;  ///< index in the model
};

/// The distance of two links; points and vectors in the fixed frame.
struct PairProximity {
  LinkState state = LinkState::kUnknown;  ///< state of the pair
  double distance;        ///< [m] signed, of the two witnesses; +inf when CLEAR, NaN when UNKNOWN
  double lower_bound;     ///< [m] proven; max_distance when CLEAR, -inf when UNKNOWN
  Eigen::Vector3d p_FCa;  ///< [m] witness on the first link; NaN unless NEAR or CONTACT
  Eigen::Vector3d p_FCb;  ///< [m] witness on the second link
  /// Unit vector along which the first link moves away: p_FCa - p_FCb = distance * direction.
  Eigen::Vector3d direction;
  /// False: a deadline passed before the tolerance was reached. The bounds hold all the same.
  bool finished = true;
  /// False: it is not known whether one link is inside the other, because a surface is next to an
  /// opening of a mesh, or less than some nanometres from touch; or that was not asked in time. The
  /// state is NEAR then, and `lower_bound`, which holds, is that of the links' spheres.
  bool decided = false;

  PairProximity() { reset(); }
  void reset();  ///< to UNKNOWN
};

/// Counts of a query's work, for tuning and tests.
struct SelfQueryStatistics {
  std::uint64_t pairs_searched = 0;  ///< pairs of links whose kept bounds did not suffice
  std::uint64_t steps = 0;           ///< pairs of boxes and of parts that were looked at
};

/// Distances between links of one robot.
///
/// The distance of two solids is the smallest signed distance of any point of either to the other:
/// positive when they are apart, minus the depth of the deepest point when they are not.
///
/// Apart: branch and bound over pairs of oriented boxes finds the candidates; triangles, spheres
/// and cylinders are then measured exactly (a cylinder is a cylinder, not its tessellation).
/// `distance` is that of two real points, and `distance - lower_bound` is at most the tolerance
/// where `decided`; at tolerance 0 it is the distance itself, to rounding: some 1e-14 of the
/// coordinates, or 4e-6 of them where more than 4000 pairs of boxes are equally near.
///
/// Contact: where surfaces intersect, or where one link is inside the other. `distance` is then the
/// signed distance of a point that is inside both links; the deepest point may be deeper, but no
/// deeper than `lower_bound`. Links without an inside (sheets) that intersect are NEAR at distance
/// 0.
///
/// The search of a pair is kept from run to run, with the bounds that the links' relative motion
/// leaves (temporal coherence): a pair, and within it two boxes, are looked at again when the slack
/// of their bound is used up. Poses may jump.
///
/// Each pair with a deadline first gets what is known from the last run; then the pair with the
/// least bound goes on, a little at a time, until all are finished or the time is over. Every bound
/// holds at any time.
///
/// run() never throws, locks nothing and allocates nothing. One object per thread.
class SelfQuery {
 public:
  /// Builds a hierarchy and a hull for each link: 3 s for a million triangles. Queries share the
  /// hierarchies of links of the same `solid`, also between models that differ in their packings.
  /// @param cancelled  asked every few milliseconds; true ends the building, and every pair is
  ///                   UNKNOWN. It may be empty
  SelfQuery(std::shared_ptr<const RobotModel> model, std::vector<LinkPair> pairs,
            const QueryConfig& config, const std::function<bool()>& cancelled = {});
  ~SelfQuery();
  SelfQuery(SelfQuery&&) noexcept;
  SelfQuery& operator=(SelfQuery&&) noexcept;

  /// @param X_FL     by link: link frame -> fixed frame, rigid; ignored where `known` is false. NaN
  ///                 or infinity make the link's pairs UNKNOWN
  /// @param known    by link: false makes its pairs UNKNOWN. Where it or X_FL has another size than
  ///                 the model's links, every pair is UNKNOWN
  /// @param results  one per pair, overwritten; it allocates where it has not that many yet
  /// @returns false when the deadline passed before every pair met its tolerance
  bool run(Span<const Eigen::Isometry3d> X_FL, const std::vector<bool>& known,
           std::vector<PairProximity>* results);

  /// Takes effect at the next run().
  void set_config(const QueryConfig& config);

  const std::vector<LinkPair>& pairs() const;     ///< the ones given to the constructor
  const SelfQueryStatistics& statistics() const;  ///< of the last run()

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Pairs of links, by name.
using NamePairs = std::vector<std::pair<std::string, std::string>>;

/// Pairs of usable links that may collide: all except adjacent links (parent and child, also with
/// links without geometry between them, see Kinematics::has_geometry()), links that never move
/// relative to each other, and those that `ignored` names.
/// @param wanted   by link of the model: a pair needs two
/// @param ignored  in either order; names that the model lacks have no effect
std::vector<LinkPair> self_collision_pairs(const RobotModel& model, const Kinematics& kinematics,
                                           const std::vector<bool>& wanted,
                                           const NamePairs& ignored);

/// Selects the pairs that are in contact at rest: with all joints at zero, or at the limit nearest
/// to zero. A pair with a planar or floating joint between its links is not among them, because
/// such a joint has no rest.
/// @param cancelled  as for SelfQuery; no pair is selected then
std::vector<LinkPair> in_contact_at_rest(const std::shared_ptr<const RobotModel>& model,
                                         const Kinematics& kinematics,
                                         const std::vector<LinkPair>& pairs,
                                         const std::function<bool()>& cancelled = {});

/// How pairs of links behave over random configurations.
struct PairSampling {
  std::size_t configurations = 2000;  ///< drawn evenly between the joints' limits
  std::uint64_t seed = 1;             ///< the same seed gives the same configurations
};

/// The finding of sampling about a pair. It is evidence, not proof: a pair that was never in
/// contact may be, in a configuration that was not drawn.
struct SampledPair {
  LinkPair pair;             ///< the links
  std::size_t contacts = 0;  ///< configurations in which the links are in contact
  std::size_t measured = 0;  ///< configurations in which that is known
  bool always() const { return measured > 0 && contacts == measured; }  ///< always in contact
  bool never() const { return measured > 0 && contacts == 0; }          ///< never in contact
};

/// Measures pairs at random configurations. Joints without limits are drawn over one turn.
/// Planar and floating joints, and slides without limits, cannot be drawn: pairs with such a joint
/// between them are not measured. Deterministic.
/// @param cancelled  asked between configurations; true ends the sampling. May be empty
/// @returns one per pair
std::vector<SampledPair> sample_pairs(const std::shared_ptr<const RobotModel>& model,
                                      const Kinematics& kinematics,
                                      const std::vector<LinkPair>& pairs,
                                      const PairSampling& sampling,
                                      const std::function<bool()>& cancelled = {});

/// An SRDF with a `<disable_collisions>` for each pair: by what the links are to each other
/// (reason="Adjacent"), and by what was sampled (reason="Always", "Never").
/// @param never  whether to disable pairs that were never in contact: convenient, and no proof
std::string to_srdf(const RobotModel& model, const Kinematics& kinematics,
                    const std::vector<SampledPair>& sampled, bool never);

}  // namespace ist
