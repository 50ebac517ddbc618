#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

namespace ist {

/// What was found about places in a link's frame where points were when they were measured. A
/// distance changes by no more than the way between two places: so it tells of a point that has
/// moved in that frame, too. Each stays with the place where it was measured, so ways do not add
/// up. Newer ones take the places of older ones.
class KnownDistances {
 public:
  enum class Kind : std::uint8_t {
    kOutside,  ///< of a point to the surface
    kPoint     ///< PointDepth::floor of a point
  };

  KnownDistances() : places_(kPlaces) {}

  /// @param index  build_id of the index, not 0
  /// @param id     of the point there
  /// @returns [m] what is kept is at least, now that the point is at p_L; -inf: unknown
  double at(std::uint64_t index, Kind kind, std::uint32_t id, const Eigen::Vector3d& p_L) const;
  void keep(std::uint64_t index, Kind kind, std::uint32_t id, const Eigen::Vector3d& p_L,
            double floor);

 private:
  struct Place {
    std::uint64_t index = 0;
    std::uint32_t id = 0;
    Kind kind = Kind::kOutside;
    double floor = 0.0;
    Eigen::Vector3d p_L = Eigen::Vector3d::Zero();
  };
  static constexpr std::size_t kPlaces = 512;
  static std::size_t slot(Kind kind, std::uint32_t id) {
    return ((id + (static_cast<std::uint32_t>(kind) << 30U)) * 2654435761U) >> 23U;
  }

  std::vector<Place> places_;
};

}  // namespace ist
