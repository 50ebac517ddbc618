#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "peers/scene.h"

/// Methods that find the minimum distance from each link of a robot to a cloud, and its witness
/// points.
namespace ist::benchmark {

/// Answer for one link, in the fixed frame.
struct Answer {
  double distance;        ///< [m]
  Eigen::Vector3d p_FCl;  ///< [m] witness point on the link (or its spheres)
  Eigen::Vector3d p_FCo;  ///< [m] witness point on the obstacle
};

class Method {
 public:
  Method() = default;
  Method(const Method&) = delete;
  Method& operator=(const Method&) = delete;
  virtual ~Method() = default;

  /// Prepares queries from the bytes of a message.
  virtual void ingest(const Frame& frame) = 0;

  /// @param answers  one per link, overwritten
  virtual void query(const Poses& X_FL, std::vector<Answer>* answers) = 0;

  std::string name;
  /// What distances are computed with: "ours", the mesh to a tolerance by this library; "exact",
  /// the mesh; "spheres" instead of the link; "grid", distances of the link at nodes.
  std::string kind = "exact";
  std::size_t spheres = 0;
  double max_error = 0.0;  ///< [m] of the packing, for ours
  double tolerance = 0.0;  ///< [m] of the query, for ours

  /// [m] Limits of distance - truth without contact; checked before anything is timed.
  double least_error = -kRounding, largest_error = kRounding;
  /// The method measures the unsigned distance to the surface, which is checked in contact, too.
  bool is_unsigned = false;
  /// [m] Allowed difference between `distance` and the distance of the witness points.
  double witness_error = kRounding;

  static constexpr double kRounding = 2e-5;  ///< [m] of float coordinates, with a margin
};

using Methods = std::vector<std::unique_ptr<Method>>;

// Each function adds its methods. Those whose library is not installed do not exist.
void add_ours(const Robot& robot, Methods* methods);
void add_nanoflann(const Robot& robot, Methods* methods);
void add_signed_grid(const Robot& robot, Methods* methods);
void add_embree(const Robot& robot, Methods* methods);
void add_fcl(const Robot& robot, Methods* methods);

}  // namespace ist::benchmark
