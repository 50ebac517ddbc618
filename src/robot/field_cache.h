#pragma once

#include <memory>
#include <string>
#include <utility>

#include "internal/geometry/distance_field.h"
#include "ist_proximity/geometry/shapes.h"
#include "ist_proximity/geometry/solid.h"

namespace ist {

/// Identifies the fine distance field of a geometry: a hash over its numbers and the version of the
/// field.
std::string field_key(const LinkGeometry& geometry);

/// Fine distance fields on disk, one file per key. A header and a checksum detect files that are
/// truncated, damaged or of another version; samples of what a field says are compared with the
/// exact geometry. A file that fails counts as absent. Several processes may share a directory.
/// Thread safe.
class FieldCache {
 public:
  /// @param directory  created when needed; empty turns the cache off
  explicit FieldCache(std::string directory) : directory_(std::move(directory)) {}

  /// @param key      field_key() of the solid's geometry
  /// @param warning  set to one sentence when there is a file that cannot be used
  /// @returns null where there is none
  std::shared_ptr<const DistanceField> load(const std::string& key, const Solid& solid,
                                            std::string* warning) const;
  /// @param warning  set to one sentence when the file cannot be written
  void store(const std::string& key, const DistanceField& field, std::string* warning) const;

 private:
  std::string path(const std::string& key) const;

  std::string directory_;
};

/// Compares a field with its solid: the box, and the values at a few hundred nodes.
/// @returns empty, or what is wrong
std::string field_fault(const DistanceField& field, const Solid& solid);

}  // namespace ist
