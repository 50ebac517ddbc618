#pragma once

#include "ist_proximity/geometry/shapes.h"
#include "ist_proximity/packing/packing.h"

namespace ist {

/// Part of every cache key: raise it whenever the same shape and configuration pack differently.
constexpr int kPackingVersion = 4;

/// Packs a mesh with inner spheres, in the order of `config.order`, until the certified gap of
/// every surface patch (and of the interior) is at most `config.max_error`.
///
/// A patch's gap is bounded by convexity: the distance to a sphere is convex, so over a triangle it
/// is largest at a corner; the patch with the largest bound is split, or gets the medial sphere
/// that touches it. Where no sphere fits (open sheets, flaps), spheres of radius 0 on the surface
/// take over, so any mesh can be covered. Deterministic.
///
/// In disjoint packings no two inner spheres overlap, interior ones included; their cover spheres
/// do.
/// @throws ModelError if the mesh has no triangle, or one with a corner that is not finite or not
///         there.
Packing pack_mesh(const TriangleMesh& mesh, const PackingConfig& config,
                  const PackingProgress& progress = {});

/// Packs one URDF element, in the element's frame: a sphere is one sphere without gap; boxes and
/// cylinders are packed through an inscribed mesh whose deviation is added to every gap.
Packing pack_element(const Shape& shape, const PackingConfig& config,
                     const PackingProgress& progress = {});

}  // namespace ist
