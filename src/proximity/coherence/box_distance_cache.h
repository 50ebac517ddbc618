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
/// any box, less its displacement from there. A box that was outside a closed surface stays outside
/// while it has not moved as far as the surface was away.
class BoxDistanceCache {
 public:
  struct Kept {
    double lower_bound = -std::numeric_limits<double>::infinity();  ///< [m] -inf: none is known
    bool is_outside = false;  ///< wholly outside a closed link
  };

  BoxDistanceCache() : entries_(kEntries) {}

  /// @param key  finds the entry; it decides how good the bound is, not whether it holds
  /// @returns a lower bound of the distance to the surface, and whether the box is outside
  Kept find(std::uint32_t key, const PlacedBox& box) const;
  /// @param kept  of a link with holes, `is_outside` is false: a box may leave its inside, or come
  ///              into it, where no surface is
  void store(std::uint32_t key, const PlacedBox& box, const Kept& kept);

  std::size_t memory() const { return entries_.capacity() * sizeof(Entry); }  ///< [bytes]

 private:
  struct Entry {
    std::uint32_t key = 0;
    Kept kept;
    PlacedBox box;
  };
  static constexpr std::size_t kEntries = 1024, kWays = 4;
  /// The first of the kWays entries that may hold a key.
  static std::size_t first(std::uint32_t key) { return kWays * ((key * 2654435761U) >> 24U); }
  static_assert(kEntries == kWays << 8U, "eight bits choose");

  std::vector<Entry> entries_;
};

}  // namespace ist
