#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <memory>
#include <string>
#include <vector>

#include "peers/scene.h"

/// One way to do the job: for each link of a robot the minimum distance to a cloud, and where.
namespace ist::benchmark {

/// Of one link, in the fixed frame.
struct Answer {
  double distance;        ///< [m]
  Eigen::Vector3d p_FCl;  ///< [m] on the link (or what stands for it)
  Eigen::Vector3d p_FCo;  ///< [m] on the obstacle
};

/// What the distance is measured to.
enum class Kind {
  kFloor,    ///< no answer: what the memory alone costs
  kOurs,     ///< the mesh, to a tolerance
  kExact,    ///< the mesh
  kSpheres,  ///< spheres that stand for the link
  kGrid      ///< the cloud is replaced by cells, too
};

class Method {
 public:
  Method() = default;
  Method(const Method&) = delete;
  Method& operator=(const Method&) = delete;
  virtual ~Method() = default;

  /// From the bytes of a message to what queries need.
  virtual void ingest(const Frame& frame) = 0;

  /// @param X_FL     by link
  /// @param answers  one per link, overwritten
  virtual void query(const std::vector<Eigen::Isometry3d>& X_FL, std::vector<Answer>* answers) = 0;

  std::string name;
  Kind kind = Kind::kExact;
  std::size_t spheres = 0;
  double max_error = 0.0;  ///< [m] of ours: what the links are packed to
  double tolerance = 0.0;  ///< [m] of ours

  /// [m] What distance - truth must be in, where there is no contact; checked before anything is
  /// timed.
  double least_error = -kRounding, largest_error = kRounding;
  /// Measures the unsigned distance to the surface, so that it can be checked in contact as well.
  bool is_unsigned = false;
  /// The witnesses are `distance` apart, to this [m].
  double witness_error = kRounding;
  /// Only every n-th configuration is queried, where one takes long.
  std::size_t every = 1;

  static constexpr double kRounding = 2e-5;  ///< [m] of float coordinates, with room to spare
};

using Methods = std::vector<std::unique_ptr<Method>>;

// Each adds its methods; those whose library is not there do not exist.
void add_floors(const Robot& robot, const SphereSet& spheres, Methods* methods);
void add_ours(const Robot& robot, Methods* methods);
void add_nanoflann(const SphereSet& spheres, Methods* methods);
void add_pcl(const SphereSet& spheres, Methods* methods);
void add_signed_grid(const Robot& robot, Methods* methods);
void add_embree(const Robot& robot, Methods* methods);
void add_cgal(const Robot& robot, Methods* methods);
void add_fcl(const Robot& robot, Methods* methods);
void add_dynamic_edt(const SphereSet& spheres, Methods* methods);

}  // namespace ist::benchmark
