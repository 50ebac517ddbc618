#pragma once

#include <assimp/scene.h>

#include <assimp/Importer.hpp>
#include <string>

#include "internal/geometry/cancelled.h"

namespace ist {

/// Lets assimp read a mesh file whose bytes are in memory. Other files that it names are opened
/// only where they are regular and not too large; a material file, which has no triangles, never.
/// @param reason  set where the result is null
/// @returns owned by the importer; null where the file is no mesh
/// @throws Cancelled
const aiScene* import_mesh(const std::string& path, const std::string& bytes,
                           const CancelRequest& cancelled, Assimp::Importer* importer,
                           std::string* reason);

}  // namespace ist
