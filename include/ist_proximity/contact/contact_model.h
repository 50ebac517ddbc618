#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/geometry/shapes.h"
#include "ist_proximity/packing/packing.h"
#include "ist_proximity/robot/robot_model.h"

namespace ist {

/// How the spheres that contact volumes are summed over are made.
struct ContactConfig {
  /// How a link is packed; each attached object is packed like a link.
  PackingConfig packing = {0.002, 500, PackingOrder::kDisjoint};
  /// [s] > 0: packing one element stops after it, and a disjoint part of the packing for distances
  /// is used instead.
  double time_limit = 30.0;
};

struct ContactSpheres;  // src/contact/contact_spheres.h

/// A link's volume: a disjoint packing in an Inner Sphere Tree. Immutable; share it by pointer.
///
/// Spheres leave voids between them. Each sphere stands for its cell of the spheres' power diagram
/// within the link, so that a link's spheres together have the link's volume, and no part of it
/// counts twice, whether elements of the link overlap or not.
///
/// The outward field is a smooth vector field o: of unit length near a flat surface, pointing
/// outward, and zero where all sides are equally near, as any continuous field must be somewhere
/// inside. At p it is the mean of the directions to all points s of the surface, weighted by
/// area / |s - p|^4. Around each sphere's centre it is taken as linear.
struct ContactGeometry {
  std::shared_ptr<const ContactSpheres> spheres;  ///< null: the link has no volume
  std::size_t sphere_count = 0;                   ///< spheres of the packing
  double volume = 0.0;         ///< [m^3] of the link: spheres, and voids by counting on a grid
  double packed_volume = 0.0;  ///< [m^3] of the spheres
  bool from_cache = false;     ///< the packings were read from the cache
  double time = 0.0;           ///< [s] that building it took
  std::string note;            ///< a sentence for users; empty: nothing to say

  /// Whether there are spheres to sum over.
  bool has_volume() const { return spheres != nullptr; }
};

/// Contact geometry of a robot's links, as far as it is built. Immutable.
struct ContactModel {
  std::shared_ptr<const RobotModel> robot;                    ///< the model that it belongs to
  std::vector<std::shared_ptr<const ContactGeometry>> links;  ///< by link; null: not built (yet)
};

/// The contact geometry of a link, if it is built and has a volume; null otherwise.
/// @param contacts  may be null, or of another robot
const ContactGeometry* find_contact_geometry(const ContactModel* contacts, const RobotModel& robot,
                                             std::size_t link);

/// Packs a link disjointly, or takes the packings from the cache. The result for a link without
/// volume (sheets) has no spheres, and a note.
/// @param geometry   of the link, attached objects last
/// @param attached   number of attached objects
/// @param link       the same link, packed for distances
/// @param cancelled  may be empty
/// @returns null when cancelled
/// @throws ModelError when an element cannot be packed
std::shared_ptr<const ContactGeometry> build_contact_geometry(
    const LinkGeometry& geometry, std::size_t attached, const LinkModel& link,
    const ContactConfig& config, const std::string& cache_directory,
    const std::function<bool()>& cancelled = {});

/// A key of shapes, their poses in the link, and how they are packed: links with the same key have
/// the same contact geometry.
std::string contact_geometry_key(const LinkGeometry& geometry, std::size_t attached,
                                 const ContactConfig& config);

}  // namespace ist
