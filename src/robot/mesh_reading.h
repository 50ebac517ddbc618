#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "ist_proximity/geometry/shapes.h"
#include "ist_proximity/robot/robot_description.h"

namespace ist {

/// The meshes that a URDF names, each file at each scale once. They are collected first and read on
/// up to four threads then: reading takes a good part of the time until a robot has its first
/// model.
class MeshReading {
 public:
  /// @param link   the name of the first link that wants it, for progress
  /// @param uri    as the URDF names it
  /// @param path   of the file
  /// @param scale  along the mesh's axes
  /// @returns what take() asks for
  std::size_t add(const std::string& link, const std::string& uri, const std::string& path,
                  const Eigen::Vector3d& scale);

  /// Reads all meshes. A file that cannot be read costs the others nothing.
  /// @param progress  may be empty; called from any thread, one call at a time
  /// @throws Cancelled when `progress` ended it
  void read(const ReadingProgress& progress);

  /// A mesh that was read; once for each add().
  /// @throws ModelError where its file cannot be read
  TriangleMesh take(std::size_t index);

 private:
  struct File {
    std::string link, uri, path;
    Eigen::Vector3d scale;
    std::size_t uses = 0;
    TriangleMesh mesh;
    std::string error;
  };

  std::vector<File> files_;
  std::map<std::string, std::size_t> index_;  ///< by path and scale
};

}  // namespace ist
