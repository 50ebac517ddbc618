#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

namespace ist {

/// A box in the frame of a link.
struct PlacedBox {
  /// @param box_O  axis-aligned in a frame O
  /// @param X_LO   rigid
  PlacedBox(const Eigen::AlignedBox3d& box_O, const Eigen::Isometry3d& X_LO)
      : p_LC(X_LO * box_O.center()), half_L(X_LO.linear() * (0.5 * box_O.sizes()).asDiagonal()) {}
  PlacedBox() = default;

  Eigen::Vector3d p_LC = Eigen::Vector3d::Zero();    ///< [m] centre
  Eigen::Matrix3d half_L = Eigen::Matrix3d::Zero();  ///< [m] half edges, as columns
};

/// [m] No point of box B is farther from box A; rounding included. NaN or infinite where either is.
///
/// The points of both boxes are the centre plus the half edges with weights from -1 to 1; points of
/// the same weights are compared.
double displacement(const PlacedBox& A, const PlacedBox& B);

/// Lower bounds of exact distances of boxes to the surface of a link, kept for the poses and the
/// snapshots to come, as DistanceCache keeps those of points: what is known of a place holds for
/// any box, less its displacement from there.
class BoxDistanceCache {
 public:
  BoxDistanceCache() : entries_(kEntries) {}

  /// @param key  finds the entry; it decides how good the bound is, not whether it holds
  /// @returns [m] a lower bound of the distance; -inf: none is known
  double find(std::uint32_t key, const PlacedBox& box) const;
  void store(std::uint32_t key, const PlacedBox& box, double lower_bound);

  std::size_t memory() const { return entries_.capacity() * sizeof(Entry); }  ///< [bytes]

 private:
  struct Entry {
    std::uint32_t key = 0;
    double lower_bound = -std::numeric_limits<double>::infinity();
    PlacedBox box;
  };
  static constexpr std::size_t kEntries = 512;
  static std::size_t slot(std::uint32_t key) { return (key * 2654435761U) >> 23U; }

  std::vector<Entry> entries_;
};

}  // namespace ist
