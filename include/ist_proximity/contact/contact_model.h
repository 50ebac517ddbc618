#pragma once

#include <Eigen/Core>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/packing/packing.h"
#include "ist_proximity/robot/robot_description.h"
#include "ist_proximity/robot/robot_model.h"
#include "ist_proximity/tree/inner_sphere_tree.h"

namespace ist {

/// How the spheres that contact volumes are summed over are made.
struct ContactConfig {
  PackingConfig packing = {0.002, 500, PackingOrder::kDisjoint};
  /// [s] packing of one element is broken off after it, and a disjoint part of the packing for
  /// distances taken in its place; > 0.
  double time_limit = 30.0;
};

/// Up to eight spheres of a disjoint packing, side by side for SIMD, in the link's frame.
struct alignas(32) ContactLeaf {
  float x[kSphereWidth], y[kSphereWidth], z[kSphereWidth];  ///< [m] centres
  float radius[kSphereWidth];                               ///< [m] negative in unused slots
  /// The volume that a sphere stands for, in volumes of its own; >= 1, 0 in unused slots.
  float share[kSphereWidth];
  float out[3][kSphereWidth];    ///< way out at the centre, see ContactBody
  float slope[9][kSphereWidth];  ///< [1/m] its derivative, row-major
};

/// A link as its volume: a disjoint packing in a tree. Immutable; share it by pointer.
///
/// Spheres leave voids between them. Each stands for its cell of the spheres' power diagram within
/// the link, so that a link's spheres together have the link's volume, and no part of it twice,
/// whether elements of the link overlap or not.
///
/// The way out is a smooth vector field o: of unit length near a flat surface, pointing outward,
/// and zero where all sides are equally near, as any continuous field must be somewhere inside. At
/// p it is the mean of the directions to all points s of the surface, weighted by area / |s - p|^4.
/// BoundingSphere each sphere it is taken as linear.
struct ContactBody {
  InnerSphereTree tree;             ///< over the spheres that have a volume
  std::vector<ContactLeaf> leaves;  ///< the same leaves as the tree's
  std::size_t sphere_count = 0;
  double volume = 0.0;         ///< [m^3] of the link: spheres, and voids by counting on a grid
  double packed_volume = 0.0;  ///< [m^3] of the spheres
  bool from_cache = false;
  double time = 0.0;  ///< [s] it took
  std::string note;   ///< what a user should know; empty: nothing

  bool has_volume() const { return !tree.empty(); }
};

/// The links' bodies, as far as they are there. Immutable.
struct ContactModel {
  std::shared_ptr<const RobotModel> robot;                 ///< what they belong to
  std::vector<std::shared_ptr<const ContactBody>> bodies;  ///< by link; null: not there (yet)
};

/// The body of a link, if it is there and has a volume; null otherwise.
/// @param contacts  may be null, or of another robot
const ContactBody* find_body(const ContactModel* contacts, const RobotModel& robot,
                             std::size_t link);

/// Packs a link disjointly, or takes the packings from the cache. A link without volume (sheets)
/// has a body without spheres and a note.
/// @param geometry   of the link, attached objects last
/// @param attached   number of attached objects
/// @param link       the same link, packed for distances
/// @param cancelled  may be empty
/// @returns null when cancelled
/// @throws ModelError when an element cannot be packed
std::shared_ptr<const ContactBody> build_contact_body(const LinkGeometry& geometry,
                                                      std::size_t attached, const LinkModel& link,
                                                      const ContactConfig& config,
                                                      const std::string& cache_directory,
                                                      const std::function<bool()>& cancelled = {});

/// Links with the same key have the same body: shapes, their places, and how they are packed.
std::string contact_body_key(const LinkGeometry& geometry, std::size_t attached,
                             const ContactConfig& config);

/// The largest spheres of a packing that do not overlap, `count` at most, the largest first.
Packing disjoint_part(const Packing& packing, std::size_t count);

/// Of a packing that is there.
/// @param packing  disjoint within each element
ContactBody make_contact_body(const LinkGeometry& geometry, const Solid& solid,
                              const Packing& packing);

}  // namespace ist
