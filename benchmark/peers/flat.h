#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <vector>

#include "peers/method.h"

// GCC compiles what is marked for several instruction sets and picks one at run time.
#if defined(__GNUC__) && !defined(__clang__) && defined(__x86_64__)
#define IST_BENCHMARK_SIMD __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define IST_BENCHMARK_SIMD
#endif

/// Passes over all points, without an index.
namespace ist::benchmark {

/// [m^2] Of every point to a box in the frame of a link: what the point is at least away from it.
/// @param X_LF  fixed frame -> link frame
void box_distances_sq(const Points& points, const Eigen::Isometry3d& X_LF,
                      const Eigen::AlignedBox3f& box, std::vector<float>* distances_sq);

/// Index of the point nearest to `center`.
std::size_t nearest_of_all(const Points& points, const Eigen::Vector3f& center);

/// Spheres that stand for the links, one after the other; each is only asked for what is nearer
/// than the link's spheres before it.
class BySpheres : public Method {
 public:
  explicit BySpheres(const SphereSet& set) : set_(set) { spheres = set.size(); }
  void query(const std::vector<Eigen::Isometry3d>& X_FL, std::vector<Answer>* answers) override;

 protected:
  struct Nearest {
    Eigen::Vector3d p_FCo;
    double distance;  ///< [m]
  };
  /// What is nearest to `center` (fixed frame). @returns false where it can tell that nothing is
  /// within `reach` [m] > 0, which may be infinite
  virtual bool nearest(const Eigen::Vector3d& center, double reach, Nearest* found) = 0;

 private:
  SphereSet set_;
};

/// A link's exact distance, point by point: what the box leaves, the last answer's point first.
class PrunedByBox : public Method {
 public:
  explicit PrunedByBox(const Robot& robot);
  void ingest(const Frame& frame) override;
  void query(const std::vector<Eigen::Isometry3d>& X_FL, std::vector<Answer>* answers) override;

 protected:
  /// Whether the surface of the link is nearer to p_L than `*distance`; if so, sets it and the
  /// surface point.
  virtual bool closest(std::size_t link, const Eigen::Vector3f& p_L, float* distance,
                       Eigen::Vector3d* surface_L) = 0;

 private:
  Points points_;
  std::vector<Eigen::AlignedBox3f> boxes_;
  std::vector<std::size_t> last_;  // nearest point by link
  std::vector<float> bound_sq_;
};

}  // namespace ist::benchmark
