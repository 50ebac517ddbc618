#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
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

  PairProximity() { reset(); }
  void reset();  ///< to UNKNOWN
};

/// Distances between links of one robot.
///
/// The distance of two solids is the smallest signed distance of any point of either to the other:
/// positive when they are apart, minus the depth of the deepest point when they are not.
///
/// Lower bound: the cover spheres of a link A cover it. The exact signed distance of a sphere's
/// centre to the other link B, less the cover radius, bounds the distance of that sphere from
/// below, because signed distances change no faster than points move. Best-first branch and bound
/// in A's tree finds the smallest of these bounds; bounds from B's tree avoid most exact
/// evaluations. A is the link with the smaller gap; where the links may touch, the search runs in
/// both directions.
///
/// Upper bound: `distance` is measured between two real points, which alternating projections
/// between the surfaces find, starting from the nearest spheres. It is not below the true distance.
/// For links that are apart it is above `lower_bound` by no more than max_error of A's packing and
/// the tolerance. Where they nearly touch, A's interior gap is added to this, and wherever one of
/// the meshes has holes both interior gaps are. In contact the two may differ by more. Where solids
/// merely touch, the state may be NEAR with a lower bound below 0.
///
/// run() never throws. One object per thread.
class SelfQuery {
 public:
  /// @param config  max_distance, tolerance and margin are read
  SelfQuery(std::shared_ptr<const RobotModel> model, std::vector<LinkPair> pairs,
            const QueryConfig& config);
  ~SelfQuery();
  SelfQuery(SelfQuery&&) noexcept;
  SelfQuery& operator=(SelfQuery&&) noexcept;

  /// @param X_FL     by link: link frame -> fixed frame, rigid
  /// @param known    by link: false makes its pairs UNKNOWN. Where it or X_FL has another size than
  ///                 the model's links, every pair is UNKNOWN
  /// @param results  one per pair, overwritten
  void run(Span<const Eigen::Isometry3d> X_FL, const std::vector<bool>& known,
           std::vector<PairProximity>* results);

  /// Takes effect at the next run().
  void set_config(const QueryConfig& config);

  const std::vector<LinkPair>& pairs() const;  ///< the ones given to the constructor

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Pairs of links, by name.
using NamePairs = std::vector<std::pair<std::string, std::string>>;

/// Pairs of usable links that may collide: all except adjacent links (parent and child, also with
/// links without geometry between them), links that never move relative to each other, and those
/// that `ignored` names.
/// @param wanted   by link of the model: a pair needs two
/// @param ignored  in either order; names that the model lacks have no effect
std::vector<LinkPair> self_collision_pairs(const RobotModel& model, const Kinematics& kinematics,
                                           const std::vector<bool>& wanted,
                                           const NamePairs& ignored);

/// Selects the pairs that are in contact at rest: with all joints at zero, or at the limit nearest
/// to zero. A pair with a planar or floating joint between its links is not among them, because
/// such a joint has no rest.
std::vector<LinkPair> in_contact_at_rest(const std::shared_ptr<const RobotModel>& model,
                                         const Kinematics& kinematics,
                                         const std::vector<LinkPair>& pairs);

/// Reads the `<disable_collisions>` elements of an SRDF.
/// @throws ModelError when the text is no SRDF
NamePairs disabled_collisions(const std::string& srdf_xml);

}  // namespace ist
