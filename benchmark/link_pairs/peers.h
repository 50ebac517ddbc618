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
  /// @param distances  [m] by pair
  virtual void run(const std::vector<Eigen::Isometry3d>& X_FL, std::vector<double>* distances) = 0;
};

/// FCL, a hierarchy of OBBRSS boxes for each link: exact, each query anew.
std::vector<std::unique_ptr<PairPeer>> fcl_peers(const Robot& robot);

}  // namespace ist::benchmark
