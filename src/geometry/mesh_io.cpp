#include "internal/geometry/mesh_io.h"

#include <assimp/scene.h>

#include <Eigen/Geometry>
#include <array>
#include <assimp/Importer.hpp>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <locale>
#include <sstream>
#include <unordered_map>
#include <utility>

#include "geometry/collada_check.h"
#include "geometry/mesh_file_checks.h"
#include "geometry/mesh_import.h"
#include "geometry/orientation.h"
#include "internal/geometry/limits.h"
#include "internal/geometry/regular_file.h"
#include "ist_proximity/geometry/error.h"

namespace ist {
namespace {

[[noreturn]] void fail(const std::string& path, const std::string& what) {
  throw ModelError("mesh file '" + printable(path) + "' " + what);
}

std::string read_mesh_file(const std::string& path, const CancelRequest& cancelled,
                           std::string* unit) {
  std::string bytes;
  const std::string fault = read_regular_file(path, kMaxMeshFileSize, &bytes, cancelled);
  if (fault == "does not exist") {
    fail(path, "does not exist; check the URDF's mesh filename and the package it names");
  }
  if (!fault.empty()) fail(path, fault + "; name the mesh file itself");
  if (bytes.empty()) fail(path, "is empty (0 bytes); export or download it again");
  const std::string format = mesh_format(path);
  for (const std::string& damage :
       {format_fault(format), declared_size_fault(format, bytes),
        format == "stl" ? normalize_stl(&bytes) : std::string(),
        format == "dae" ? collada_fault(bytes, &bytes, unit) : std::string()}) {
    if (!damage.empty()) fail(path, damage);
  }
  return bytes;
}

void check_scale(const std::string& path, const Eigen::Vector3d& scale) {
  const std::string fault = scale_fault(scale);
  if (!fault.empty()) fail(path, fault);
}

// Metres per unit of a Collada file. It is read here, as in rviz. Assimp's root node, which holds
// its own conversion of unit and up-axis, is skipped.
// @param text  of <unit meter="...">
double collada_unit(const std::string& path, const std::string& text) {
  if (text.empty()) return 1.0;
  std::istringstream stream(text);
  stream.imbue(std::locale::classic());
  double meter = 0.0;
  if (!(stream >> meter) || !(meter > 0.0 && meter <= kMaxScale)) {
    fail(path, "has <unit meter=\"" + printable(text) +
                   "\">; it must be a number of metres > 0, such as 0.001 for millimetres");
  }
  return meter;
}

Eigen::Affine3d to_eigen(const aiMatrix4x4& m) {
  Eigen::Affine3d X = Eigen::Affine3d::Identity();
  X.linear() << m.a1, m.a2, m.a3, m.b1, m.b2, m.b3, m.c1, m.c2, m.c3;
  X.translation() << m.a4, m.b4, m.c4;
  return X;
}

// Collects triangles, with one vertex for all corners at the same coordinates.
class MeshBuilder {
 public:
  MeshBuilder(const std::string& path, const Eigen::Vector3d& scale, const CancelRequest& cancelled)
      : path_(path), scale_(scale), watch_(cancelled) {}

  void add_node(const aiScene& scene, const aiNode& node, const Eigen::Affine3d& X_MP) {
    const Eigen::Affine3d X_MN = X_MP * to_eigen(node.mTransformation);
    for (unsigned i = 0; i < node.mNumMeshes; ++i) add_mesh(*scene.mMeshes[node.mMeshes[i]], X_MN);
    add_children(scene, node, X_MN);
  }

  // Assimp would take a second for a million facets, and not stop.
  void add_binary_stl(const std::string& bytes, std::size_t facets) {
    for (std::size_t f = 0; f < facets; ++f) {
      watch_.step();
      std::array<float, 9> numbers{};
      std::memcpy(numbers.data(), &bytes[kStlHead + f * kStlFacet + kStlNormal], sizeof numbers);
      const Eigen::Map<const Eigen::Matrix3f> corners(numbers.data());
      add_triangle(corners.cast<double>(), Eigen::Affine3d::Identity());
    }
  }

  void add_children(const aiScene& scene, const aiNode& node, const Eigen::Affine3d& X_MN) {
    for (unsigned i = 0; i < node.mNumChildren; ++i) add_node(scene, *node.mChildren[i], X_MN);
  }

  TriangleMesh take() { return std::move(mesh_); }

 private:
  struct Hash {
    std::size_t operator()(const std::array<double, 3>& p) const {
      const std::hash<double> hash;
      return (hash(p[0]) * 31 + hash(p[1])) * 31 + hash(p[2]);
    }
  };

  void add_mesh(const aiMesh& mesh, const Eigen::Affine3d& X_MN) {
    for (unsigned f = 0; f < mesh.mNumFaces; ++f) {
      watch_.step();
      const aiFace& face = mesh.mFaces[f];
      if (face.mNumIndices != 3) continue;
      Eigen::Matrix3d corners;
      for (unsigned k = 0; k < 3; ++k) {
        const aiVector3D& v = mesh.mVertices[face.mIndices[k]];
        corners.col(k) << v.x, v.y, v.z;
      }
      add_triangle(corners, X_MN);
    }
  }

  // @param corners  of the node N, by column
  void add_triangle(const Eigen::Matrix3d& corners, const Eigen::Affine3d& X_MN) {
    if (mesh_.triangles.size() == kMaxTriangles) {
      fail(path_, "has more than " + std::to_string(kMaxTriangles) +
                      " triangles; simplify it, a few ten thousand are plenty for a link");
    }
    TriangleMesh::Triangle triangle;
    for (int k = 0; k < 3; ++k) {
      triangle[static_cast<std::size_t>(k)] = vertex(scale_.cwiseProduct(X_MN * corners.col(k)));
    }
    // A mirror reverses the corners' order; swapping two of them keeps outside outside.
    const bool mirrored = (scale_.prod() < 0.0) != (X_MN.linear().determinant() < 0.0);
    if (mirrored) std::swap(triangle[1], triangle[2]);
    mesh_.triangles.push_back(triangle);
  }

  std::uint32_t vertex(const Eigen::Vector3d& p) {
    if (!(p.cwiseAbs().maxCoeff() <= kMaxLength && p.allFinite())) {
      std::ostringstream text;
      text << "has a vertex at (" << p.transpose() << ") after its transforms and scale ("
           << scale_.transpose() << "); repair the mesh: coordinates must be finite and at most "
           << kMaxLength << " m";
      fail(path_, text.str());
    }
    // + 0.0 turns -0.0 into 0.0.
    const auto [entry, is_new] =
        vertices_.insert({{p.x() + 0.0, p.y() + 0.0, p.z() + 0.0},
                          static_cast<std::uint32_t>(mesh_.vertices.size())});
    if (is_new) mesh_.vertices.push_back(p);
    return entry->second;
  }

  const std::string& path_;
  const Eigen::Vector3d scale_;
  CancelWatch watch_;
  TriangleMesh mesh_;
  std::unordered_map<std::array<double, 3>, std::uint32_t, Hash> vertices_;
};

}  // namespace

TriangleMesh load_mesh(const std::string& path, const Eigen::Vector3d& scale,
                       const CancelRequest& cancelled) {
  check_scale(path, scale);
  std::string unit_text;
  const std::string bytes = read_mesh_file(path, cancelled, &unit_text);
  const std::string format = mesh_format(path);
  MeshBuilder builder(path, collada_unit(path, unit_text) * scale, cancelled);
  const std::size_t facets = format == "stl" ? binary_stl_facets(bytes) : 0;
  if (facets > 0) {
    builder.add_binary_stl(bytes, facets);
  } else {
    Assimp::Importer importer;
    std::string reason;
    const aiScene* scene = import_mesh(path, bytes, cancelled, &importer, &reason);
    if (scene == nullptr) {
      fail(path, "cannot be read as a mesh (" + printable(reason) +
                     "); STL, DAE and OBJ are known to work");
    }
    const Eigen::Affine3d X_MR = Eigen::Affine3d::Identity();
    if (format == "dae") {
      // The root holds nothing but assimp's conversion of unit and up-axis.
      builder.add_children(*scene, *scene->mRootNode, X_MR);
    } else {
      builder.add_node(*scene, *scene->mRootNode, X_MR);
    }
  }
  TriangleMesh mesh = builder.take();
  if (mesh.triangles.empty()) {
    fail(path, "holds no triangle; export the surface as triangles or polygons");
  }
  orient_outward(&mesh, cancelled);  // some exporters write meshes inside out
  return mesh;
}

}  // namespace ist
