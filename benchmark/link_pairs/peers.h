#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <string>
#include <vector>

#include "link_pairs/robot.h"

namespace ist::benchmark {

/// Another library that measures the distances of all pairs of a robot's links.
class PairPeer {
 public:
  virtual ~PairPeer() = default;
  virtual std::string name() const = 0;
  /// The distances are to be within this of the exact ones [m].
  virtual double tolerance() const = 0;
  /// Whether it starts from its last answer.
  virtual bool is_warm() const = 0;
  /// @param distances  [m] by pair
  virtual void run(const std::vector<Eigen::Isometry3d>& X_FL, std::vector<double>* distances) = 0;
};

/// FCL, a hierarchy of OBBRSS boxes for each link: exact, each query anew; and to 1 mm, with the
/// last answer's triangles for the first bound.
std::vector<std::unique_ptr<PairPeer>> fcl_peers(const Robot& robot);

/// Bullet: the convex hulls of the links by its GJK, whose distance is a lower bound of the
/// meshes'; and the meshes to 1 mm, by its AABB trees and its GJK for the triangles.
std::vector<std::unique_ptr<PairPeer>> bullet_peers(const Robot& robot);

}  // namespace ist::benchmark
