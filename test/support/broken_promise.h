#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <string>
#include <vector>

#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/proximity/self_query.h"
#include "support/link_pair_oracle.h"
#include "support/truth_interval.h"

/// What an answer promises, beside brute force, for tests and for fuzz targets. Each function
/// returns one sentence with the values of the first promise that does not hold, or nothing.
namespace ist::test {

/// [m] This near to a surface float may decide on which side of a mesh a point is, times `scale`.
constexpr double kSideRounding = 4e-8;

/// The truth of one link and a scene.
struct SceneTruth {
  TruthInterval measured;  ///< of the points as they were given
  TruthInterval stored;    ///< of the points as the indices hold them
  bool is_closed = true;   ///< whether the link is
  double scale = 1.0;      ///< [m] of the coordinates
};

std::string broken_promise(const LinkProximity& answer, const SceneTruth& truth,
                           const QueryConfig& config, bool is_complete);

/// What the truth of a pair needs of a link, in its frame.
struct PairBody {
  explicit PairBody(const LinkGeometry& link);

  const LinkGeometry* geometry;         ///< outlives this
  TriangleGroups surface;               ///< without curved ones
  std::vector<Eigen::Vector3d> points;  ///< [m] some of the surface
  bool has_curves = false;              ///< cylinders or spheres

 private:
  void add_curved(const GeometryElement& element);
};

/// The truth of two links, as far as it is known.
struct PairTruth {
  double surface = 0.0;   ///< [m] distance of the surfaces but for curved ones
  TruthInterval deepest;  ///< the least signed distance of a point of either to the other
  bool is_exact = true;   ///< both are closed and without curves
  double scale = 1.0;     ///< [m] of the coordinates

  /// [m] The distance is not larger.
  double highest() const { return std::min(surface, deepest.high); }
};

PairTruth pair_truth(const PairBody& a, const PairBody& b, const Eigen::Isometry3d& X_AB,
                     bool are_closed);

std::string broken_promise(const PairProximity& answer, const PairTruth& truth,
                           const QueryConfig& config, bool is_complete);

}  // namespace ist::test
