#pragma once

#include <optional>
#include <string>

#include "ist_proximity/geometry/shapes.h"
#include "ist_proximity/packing/packing.h"

namespace ist {

/// $ROS_HOME/ist_proximity, or ~/.ros/ist_proximity. Empty if neither variable is set.
std::string default_cache_directory();

/// Identifies a packing: a hash over the shape's numbers, the configuration and the version of the
/// packing algorithm. The same mesh under another file name has the same key.
std::string packing_key(const Shape& shape, const PackingConfig& config);

/// Writes a file of a cache, which appears by atomic rename. Removes what writers that were killed
/// an hour ago or earlier have left.
/// @param directory  created when needed
/// @param file_name  with the directory
/// @returns empty, or why it cannot be written
std::string write_cache_file(const std::string& directory, const std::string& file_name,
                             const std::string& bytes);

/// Packings on disk, one file per key. A header and a checksum detect files that are truncated,
/// damaged or of another version; they count as absent. Several processes may share a directory:
/// files appear by atomic rename. Thread safe.
class PackingCache {
 public:
  /// @param directory  created when needed; empty turns the cache off
  explicit PackingCache(std::string directory) : directory_(std::move(directory)) {}

  /// The stored packing of this shape, or nothing. It is checked against the shape
  /// (packing_fault()): a file that is damaged or forged in whatever way is not used.
  /// @param key       packing_key(shape, config)
  /// @param progress  as for packing_fault()
  /// @param warning   set to one sentence when there is a file that cannot be used
  std::optional<Packing> load(const std::string& key, const Shape& shape,
                              const PackingConfig& config, const PackingProgress& progress,
                              std::string* warning) const;

  /// The same without looking at a shape: the file is well-formed, and its numbers may be wrong.
  /// @param max_spheres  files with more are not read
  std::optional<Packing> load_unchecked(const std::string& key, std::size_t max_spheres,
                                        std::string* warning) const;

  /// Stores a packing. Removes what writers that were killed an hour ago or earlier have left.
  /// @param warning  set to one sentence when the file cannot be written
  /// @returns false when the file cannot be written
  bool store(const std::string& key, const Packing& packing, std::string* warning) const;

 private:
  std::string path(const std::string& key) const;

  std::string directory_;
};

}  // namespace ist
