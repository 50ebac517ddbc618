#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <string>
#include <vector>

#include "ist_proximity/geometry/shapes.h"
#include "ros/parameters/parameter_reader.h"

namespace ist {

/// A zone whose points are no obstacles, of ~zones or ~set_zone.
struct ZoneConfig {
  std::string name;
  std::string frame;                                       ///< tf's name of B
  Shape shape;                                             ///< a box, cylinder or sphere
  Eigen::Isometry3d X_BZ = Eigen::Isometry3d::Identity();  ///< the shape's frame -> B
  std::vector<std::string> links;  ///< for which its points are no obstacles; empty: for all
  double lifetime = 0.0;           ///< [s] >= 0; 0: until it is removed
};

constexpr std::size_t kMostZones = 32;
/// Zones may name so many sets of links: each set is one more look at every cloud.
constexpr std::size_t kMostLinkSets = 4;

/// [m] The sizes of a shape that a zone may have, which tell it from others of its kind; empty: no
/// zone has such a shape.
std::vector<double> zone_sizes(const Shape& shape);

/// Says what is wrong with the zones, with the name of the one that it is wrong with. Empty: they
/// can be used.
std::string zones_fault(const std::vector<ZoneConfig>& zones);

/// Reads ~zones. Mistakes go to the reader's errors.
std::vector<ZoneConfig> read_zones(ParameterReader* reader);

}  // namespace ist
