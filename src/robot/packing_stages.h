#pragma once

#include "ist_proximity/geometry/shapes.h"
#include "ist_proximity/packing/packing.h"

namespace ist {

/// The stages of an anytime packing: a few dozen spheres first, then packings with a quarter of the
/// gap each, and at last the one that is wanted. Each stage packs anew. The number of spheres grows
/// by about six from stage to stage, so that all earlier ones together take about a quarter of the
/// time of the last.

/// The first packing of a shape: a few dozen spheres, or fewer where `final` wants no more.
PackingConfig first_stage(const Shape& shape, const PackingConfig& final);

/// The packing that comes after `packing`.
PackingConfig next_stage(const Packing& packing, const PackingConfig& final);

/// Whether a packing made with `stage` is the one that `final` gives.
bool is_final_stage(const Packing& packing, const PackingConfig& stage, const PackingConfig& final);

}  // namespace ist
