#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "ist_proximity/geometry/shapes.h"
#include "ist_proximity/packing/packing.h"

namespace ist {

/// $ROS_HOME/ist_proximity, or ~/.ros/ist_proximity; empty when there is no home either.
std::string default_cache_directory();

/// Identity of a packing: a hash over the shape's own numbers, the configuration and the version
/// of the packing algorithm. The same mesh under another file name has the same key.
std::string packing_key(const Shape& shape, const PackingConfig& config);

/// Packings on disk, one file per key. A file that is truncated, damaged or of another version is
/// told apart by its header and checksum and counts as absent.
/// Several processes may share a directory: files appear by atomic rename.
class PackingCache {
 public:
  /// An empty directory name turns the cache off.
  explicit PackingCache(std::string directory) : directory_(std::move(directory)) {}

  /// The stored packing, or nothing; `warning` says why when a file was there but unusable.
  std::optional<Packing> load(const std::string& key, std::string* warning) const;

  /// Stores a packing; false, with the reason in `warning`, when the disk refuses.
  bool store(const std::string& key, const Packing& packing, std::string* warning) const;

 private:
  std::string path(const std::string& key) const;

  std::string directory_;
};

}  // namespace ist
