#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "internal/bvh/padded_box.h"
#include "internal/cloud/point_tile.h"
#include "ist_proximity/cloud/cloud_snapshot.h"
#include "ist_proximity/cloud/point_extent.h"
#include "ist_proximity/cloud/zone.h"

namespace ist {

/// Leaves out the points that belong to another group than the one that is kept.
///
/// A point belongs to the group of the first zone that holds it with the sphere that it stands for
/// (PointExtent), so that no surface outside of the zones goes with it. What rounding leaves open
/// is kept, in both groups: each point is in one group at least. Keeps its memory. Not thread safe.
class ZoneFilter {
 public:
  /// The points of a box that are left out.
  enum class Verdict { kNone, kSome, kAll };

  /// @param kept  the group of the points that stay; Zone::kNone: those in no zone
  void set_zones(const std::vector<Zone>& zones, std::size_t kept);
  /// Whether any point may be left out.
  bool is_active() const { return !zones_.empty() || kept_ != Zone::kNone; }

  /// Begins a cloud.
  /// @param X_FO    frame of the points -> fixed frame
  /// @param extent  of the points, with the sensor's place
  void begin_cloud(const Eigen::Isometry3d& X_FO, const PointExtent& extent);

  /// The verdict about the points of a box, taken for a sphere.
  Verdict test(const PaddedBox& box) const;
  /// Bit k: the point in slot k is left out.
  std::uint32_t points_left_out(const PointTile& tile) const;

 private:
  struct Placed {
    Zone zone;
    Eigen::Isometry3d X_ZO;
    double rounding;  ///< [m] more than what float rounds off
  };
  Verdict test(const Eigen::Vector3d& p_O, double radius) const;

  std::vector<Placed> zones_;
  std::size_t kept_ = Zone::kNone;
  PointExtent extent_;
  Eigen::Vector3d p_OS_ = Eigen::Vector3d::Zero();
};

/// The bits of the points that another filter or the zones leave out of a tile; those that only the
/// zones do are counted.
std::uint32_t with_zones(const ZoneFilter& zones, const PointTile& tile, std::uint32_t dropped,
                         IngestCounts* counts);

}  // namespace ist
