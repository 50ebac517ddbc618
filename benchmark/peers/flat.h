#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <vector>

#include "peers/method.h"

// GCC compiles marked functions for several instruction sets and picks one at run time.
#if defined(__GNUC__) && !defined(__clang__) && defined(__x86_64__)
#define IST_BENCHMARK_SIMD __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define IST_BENCHMARK_SIMD
#endif

/// Methods that pass over all points, without an index.
namespace ist::benchmark {

/// Squared distances of all points to a box in the frame of a link: lower bounds of their distances
/// to the link.
/// @param X_LF          fixed frame -> link frame
/// @param distances_sq  [m^2] by point, overwritten
void box_distances_sq(const Points& points, const Eigen::Isometry3d& X_LF,
                      const Eigen::AlignedBox3f& box, std::vector<float>* distances_sq);

/// Links as spheres. The nearest obstacle of each sphere is searched within the distance of the
/// best sphere of the link so far.
class BySpheres : public Method {
 public:
  explicit BySpheres(const SphereSet& set) : set_(set) { spheres = set.size(); }
  void query(const std::vector<Eigen::Isometry3d>& X_FL, std::vector<Answer>* answers) override;

 protected:
  struct Nearest {
    Eigen::Vector3d p_FCo;
    double distance;  ///< [m]
  };
  /// Finds the nearest obstacle.
  /// @param center        [m] in the fixed frame
  /// @param max_distance  [m] > 0, may be infinite
  /// @returns false if the method knows that there is nothing within `max_distance`
  virtual bool nearest(const Eigen::Vector3d& center, double max_distance, Nearest* found) = 0;

 private:
  SphereSet set_;
};

/// A link's exact distance, point by point: points that the link's box does not prune, starting
/// with the point of the last answer.
class PrunedByBox : public Method {
 public:
  explicit PrunedByBox(const Robot& robot);
  void ingest(const Frame& frame) override;
  void query(const std::vector<Eigen::Isometry3d>& X_FL, std::vector<Answer>* answers) override;

 protected:
  /// Whether the surface of the link is nearer to p_L than `*distance`. If it is, sets `*distance`
  /// and the surface point.
  virtual bool closest(std::size_t link, const Eigen::Vector3f& p_L, float* distance,
                       Eigen::Vector3d* surface_L) = 0;

 private:
  Points points_;
  std::vector<Eigen::AlignedBox3f> boxes_;
  std::vector<std::size_t> last_;  // nearest point by link
  std::vector<float> bound_sq_;
};

}  // namespace ist::benchmark
