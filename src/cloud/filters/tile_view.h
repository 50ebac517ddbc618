#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "cloud/filters/crop.h"
#include "cloud/filters/self_filter.h"
#include "internal/geometry/ray_bundle.h"
#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/cloud/view_filter.h"

namespace ist {

/// The robot as the sensor should see it in a tile of pixels: their rays against the links near the
/// tile. Keeps its memory. Not thread safe.
class TileView {
 public:
  static constexpr std::size_t kPixels = kTileSide * kTileSide;

  /// A ray, and where it meets the robot.
  struct Sight {
    double t = std::numeric_limits<double>::infinity();  ///< [m] inf: it misses
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();    ///< unit, sensor frame
    const SelfFilter::Link* link = nullptr;              ///< null: it misses
  };

  /// Prepares for robots of so many links.
  void reserve(std::size_t links) {
    others_.reserve(links);
    bundles_.reserve(links);
  }

  /// Reads a tile's points.
  /// @param row, column  of its first pixel
  /// @param kept         bit 4 r + c: the pixel in row r and column c is read
  void read(const RawCloud& cloud, std::size_t row, std::size_t column, std::uint32_t kept);
  /// Begins to look at links.
  /// @param behind  [m] surfaces that are farther behind a point than this are not seen
  void begin(double behind);
  /// Adds a link. The one that most of the points are likely to be of should come first: it saves
  /// the search of links that are farther from the points. The sights do not depend on the order.
  /// @param X_LS  sensor frame -> link frame; viewed until the next begin()
  void add_link(const SelfFilter::Link& link, const Eigen::Isometry3d& X_LS);

  /// Casts the rays of some pixels, each once. @param pixels  bits of pixels that are kept
  void look_at(std::uint32_t pixels);
  /// The ray of pixel k, which has been cast: where it first meets the link whose surface is
  /// nearest to the point.
  const Sight& sight(std::size_t k) const { return sights_[k]; }

  std::uint32_t kept() const { return kept_; }
  bool is_kept(std::size_t k) const { return (kept_ >> k & 1U) != 0; }
  const Eigen::Vector3d& p_S(std::size_t k) const { return p_S_[k]; }  ///< [m] as measured
  const Eigen::Vector3d& direction(std::size_t k) const { return direction_[k]; }  ///< unit
  double range(std::size_t k) const { return range_[k]; }                          ///< [m]
  double farthest() const { return farthest_; }                                    ///< [m] range

 private:
  struct Other {
    const SelfFilter::Link* link;
    const Eigen::Isometry3d* X_LS;
  };
  struct Bundle {
    const SelfFilter::Link* link;
    Eigen::Matrix3d R_LS;
    RayBundle rays;
  };

  bool may_be_nearer(const Other& other, std::uint32_t rays) const;
  void open(const Other& other);
  void cast(const Bundle& bundle, std::uint32_t rays);

  std::uint32_t kept_ = 0;
  std::array<Eigen::Vector3d, kPixels> p_S_, direction_;
  std::array<double, kPixels> range_;
  std::array<Sight, kPixels> sights_;
  std::uint32_t looked_ = 0;              // bits of the pixels whose sights are known
  double behind_ = 0.0, farthest_ = 0.0;  // [m]
  std::vector<Other> others_;             // links whose bundles have not been needed so far
  std::vector<Bundle> bundles_;           // of links that a ray of the tile may meet
};

}  // namespace ist
