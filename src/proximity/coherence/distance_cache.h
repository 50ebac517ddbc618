#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <vector>

namespace ist {

/// Lower bounds of exact distances of obstacle points to a link, kept for the poses and the clouds
/// to come (the invariant is in displacement.h). Each entry holds the place in the link's frame
/// where its point was when it was measured, so displacements do not add up. What is known of a
/// place holds for any point: one that is found under the same key, as is the same pixel of the
/// next image, has the bound of that place less its distance from there. The cache is
/// direct-mapped: a new entry replaces an older one.
class DistanceCache {
 public:
  /// The distance of a point that an entry bounds.
  enum class Quantity : std::uint8_t {
    kUnsigned,  ///< to the surface, for a point outside
    kSigned,    ///< PointDepth::floor
    kOutside    ///< to the nearest place that may be inside, for a point outside
  };

  DistanceCache() : entries_(kEntries) {}

  /// @param key   finds the entry: a point should have the key that it had, or that a point near
  ///              it had. It decides how good the bound is, not whether it holds.
  /// @param p_LQ  [m] where the point is now, link frame
  /// @returns [m] a lower bound of the distance; -inf: none is known
  double find(Quantity quantity, std::uint32_t key, const Eigen::Vector3d& p_LQ) const;
  void store(Quantity quantity, std::uint32_t key, const Eigen::Vector3d& p_LQ, double lower_bound);

  std::size_t memory() const { return entries_.capacity() * sizeof(Entry); }  ///< [bytes]

 private:
  struct Entry {
    std::uint32_t key = 0;
    Quantity quantity = Quantity::kUnsigned;
    double lower_bound = -std::numeric_limits<double>::infinity();
    Eigen::Vector3d p_LQ = Eigen::Vector3d::Zero();
  };
  static constexpr std::size_t kEntries = 2048;
  static std::size_t slot(Quantity quantity, std::uint32_t key) {
    return ((key + (static_cast<std::uint32_t>(quantity) << 29U)) * 2654435761U) >> 21U;
  }

  std::vector<Entry> entries_;
};

}  // namespace ist
