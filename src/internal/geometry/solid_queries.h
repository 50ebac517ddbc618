#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>

#include "internal/geometry/box_distance.h"
#include "internal/geometry/mesh_surface.h"
#include "ist_proximity/geometry/solid.h"

/// The library's own queries of a Solid. They are thread safe and allocate nothing.
namespace ist {

/// The same as Solid(geometry), which takes seconds for a million triangles.
/// @throws ModelError, Cancelled
Solid make_solid(const LinkGeometry& geometry, const std::function<bool()>& cancelled);

/// The distance of a point that is known to be outside: no inside test is made.
/// @param max_distance    [m] a solid that is not nearer than this has `distance` = inf
/// @param outward_hint_L  unit vector, roughly the direction from the closest surface point to p_L;
///                        it affects the speed alone. Zero: none
/// @param tolerance       [m] the distance may be this much too large, which is found sooner
/// @param lower_bound     [m] null, or receives a lower bound of the distance, <= max_distance
SignedDistance distance_outside(const Solid& solid, const Eigen::Vector3d& p_L, double max_distance,
                                const Eigen::Vector3d& outward_hint_L = Eigen::Vector3d::Zero(),
                                double tolerance = 0.0, double* lower_bound = nullptr);

/// Whether a point is no farther than `distance` [m] from an element's surface, or is in an element
/// that is a primitive. As distance_outside() decides it, and found sooner: the first part of the
/// surface that is as near ends the search.
bool is_within_distance(const Solid& solid, const Eigen::Vector3d& p_L, double distance);

/// Known bounds of where the surface is about a point, for solids that are one mesh.
struct NearSurface {
  double within = std::numeric_limits<double>::infinity();  ///< [m] upper bound of the distance
  enum class Side { kUnknown, kInside, kOutside } side = Side::kUnknown;
};

/// The answer for one point in a search for the deepest point.
struct PointDepth {
  /// The signed distance; `distance` = inf where the search proved no more than that the point is
  /// not deeper than was asked.
  SignedDistance exact;
  /// [m] The signed distance bound at this point: a point at distance r from it has a signed
  /// distance of at least floor - r. Equals the signed distance, except for meshes with holes: on a
  /// path through a hole the signed distance jumps from d outside to -d inside, so that the floor
  /// of a point outside is -d too.
  double floor = std::numeric_limits<double>::infinity();
};

/// Signed distance and floor of p_L, if it is deeper than `min_depth` [m]. An element whose surface
/// turns out to be no farther than that is not searched to the end: `exact` may stay unknown, and
/// `floor` may be too low by less than min_depth. A negative min_depth asks for everything.
/// @param known  bounds for p_L, if any; they affect the speed alone
PointDepth point_depth(const Solid& solid, const Eigen::Vector3d& p_L, double min_depth,
                       const NearSurface& known = {});

/// PointDepth::floor of p_L.
/// @param measured  solid.signed_distance(p_L)
double distance_floor(const Solid& solid, const Eigen::Vector3d& p_L,
                      const SignedDistance& measured);

/// [m] The support function: the largest n.x over the solid's points x. A point p with a larger n.p
/// is outside; for unit n its distance is at least n.p minus the support.
/// @param tolerance  [m] the result may be this much too large, which is found sooner
/// @param at_least   [m] a known lower bound of the support; nothing smaller is returned
double support(const Solid& solid, const Eigen::Vector3d& n_L, double tolerance = 0.0,
               double at_least = -std::numeric_limits<double>::infinity());

/// The closest pair of points of the solid and a solid box, if nearer than `max_distance` [m];
/// `lower_bound` holds in any case. The distance is 0 where they touch or overlap, with one
/// exception: a box inside a mesh that touches none of its triangles has its distance to the
/// surface (the signed distance of any point of the box decides).
/// @param box_O  axis-aligned in a frame O, which the result is in
/// @param X_OL   link frame -> O, rigid
/// @param near_O  [m] if given, a place that the closest point of the solid may be near
BoxDistance distance_to_box(const Solid& solid, const Eigen::AlignedBox3d& box_O,
                            const Eigen::Isometry3d& X_OL, double max_distance,
                            const std::optional<Eigen::Vector3d>& near_O = std::nullopt);

/// Whether the solid is one mesh and nothing else.
bool is_one_mesh(const Solid& solid);

/// [bytes] of the elements, which copies of the solid share.
std::size_t memory_of(const Solid& solid);

/// Whether one is a copy of the other.
bool is_same_solid(const Solid& one, const Solid& other);

/// The surface of an element, valid as long as the solid; nothing where it is no mesh, or there is
/// no such element.
std::optional<MeshSurface> surface_of(const Solid& solid, std::size_t element);

}  // namespace ist
