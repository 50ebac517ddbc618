#pragma once

#include <Eigen/Geometry>
#include <limits>

#include "ist_proximity/proximity/proximity_query.h"
#include "support/scene.h"

/// What a query of a link among solid boxes has to answer, by brute force.
namespace ist::test {

/// Of a link among boxes.
struct BoxTruth {
  double distance = std::numeric_limits<double>::infinity();  ///< surface to the nearest box; 0:
                                                              ///< touches or crosses
  bool is_contact = false;  ///< a box lies wholly inside, or the surface crosses one
};

BoxTruth truth_of(const TriangleMesh& mesh, const CloudSnapshot& map,
                  const Eigen::Isometry3d& X_FL);

/// The least signed distance of many points of the boxes: never below the true one.
double sampled_depth(Rng* rng, const TriangleMesh& mesh, const CloudSnapshot& map,
                     const Eigen::Isometry3d& X_FL, int samples);

bool in_a_box(const CloudSnapshot& map, const Eigen::Vector3d& p_F);

/// Expects the state and the bounds of the truth, and closest points that fit them.
void expect_truth(const LinkProximity& result, const BoxTruth& truth, const TriangleMesh& mesh,
                  const CloudSnapshot& map, const Eigen::Isometry3d& X_FL,
                  const QueryConfig& config);

}  // namespace ist::test
