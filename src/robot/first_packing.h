#pragma once

#include "ist_proximity/geometry/shapes.h"
#include "ist_proximity/packing/packing.h"

namespace ist {

/// The packing of a shape that a node begins with: a few dozen spheres, or fewer where `final`
/// wants no more.
PackingConfig first_packing(const Shape& shape, const PackingConfig& final);

/// Whether a packing made with `made` is the one that `final` gives.
bool is_final(const Packing& packing, const PackingConfig& made, const PackingConfig& final);

}  // namespace ist
