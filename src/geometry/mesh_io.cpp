#include "internal/geometry/mesh_io.h"

#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <tinyxml2.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <assimp/Importer.hpp>
#include <cctype>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <locale>
#include <sstream>
#include <unordered_map>
#include <utility>

#include "geometry/collada_check.h"
#include "geometry/orientation.h"
#include "ist_proximity/geometry/error.h"

namespace ist {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail(const std::string& path, const std::string& what) {
  throw ModelError("mesh file '" + path + "' " + what);
}

void check_file(const std::string& path) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (!fs::exists(status)) {
    fail(path, "does not exist; check the URDF's mesh filename and the package it names");
  }
  if (fs::is_directory(status)) fail(path, "is a directory; name the mesh file itself");
  if (!std::ifstream(path, std::ios::binary)) {
    fail(path, std::string("cannot be opened (") + std::strerror(errno) + ")");
  }
  if (fs::file_size(path, error) == 0 && !error) {
    fail(path, "is empty (0 bytes); export or download it again");
  }
}

void check_scale(const std::string& path, const Eigen::Vector3d& scale) {
  if (scale.allFinite() && (scale.array() != 0.0).all()) return;
  std::ostringstream text;
  text << "has the scale (" << scale.transpose()
       << "); each axis must be finite and not 0 (1 leaves the size as it is)";
  fail(path, text.str());
}

std::string lower_case(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

bool is_collada(const std::string& path) {
  return lower_case(fs::path(path).extension().string()) == ".dae";
}

std::string read_bytes(std::ifstream* file, std::uint64_t begin, std::uint64_t count) {
  std::string bytes(count, '\0');
  file->clear();
  file->seekg(static_cast<std::streamoff>(begin));
  file->read(&bytes[0], static_cast<std::streamsize>(count));
  bytes.resize(static_cast<std::size_t>(file->gcount()));
  return bytes;
}

// Whether the last statement of a piece of STL text ends a solid.
bool ends_solid(std::string text) {
  std::replace(text.begin(), text.end(), '\r', '\n');
  bool ends = false;
  std::istringstream lines(lower_case(text));
  for (std::string line; std::getline(lines, line);) {
    std::string word, next;
    std::istringstream(line) >> word >> next;
    if (word == "endsolid" || (word == "end" && next == "solid")) ends = true;
    if (word == "solid" || word == "facet" || word == "vertex") ends = false;
  }
  return ends;
}

// Assimp accepts a truncated text file as a mesh, but half a link would be an unsafe link.
void check_end_of_stl(const std::string& path) {
  constexpr std::uint64_t kBinaryHead = 84, kBinaryFacet = 50, kTail = 4096;
  if (lower_case(fs::path(path).extension().string()) != ".stl") return;
  std::ifstream file(path, std::ios::binary | std::ios::ate);
  const auto size = static_cast<std::uint64_t>(file.tellg());
  const std::string head = read_bytes(&file, 0, kBinaryHead);
  if (head.compare(0, 5, "solid") != 0) return;
  if (head.size() == kBinaryHead) {  // binary files may begin with "solid", too
    std::uint32_t facets = 0;
    std::memcpy(&facets, &head[kBinaryHead - sizeof facets], sizeof facets);
    if (size == kBinaryHead + kBinaryFacet * facets) return;
  }
  const std::uint64_t tail = std::min(kTail, size);
  if (ends_solid(read_bytes(&file, size - tail, tail))) return;
  fail(path,
       "is cut off: an STL file that begins with 'solid' ends with 'endsolid'; export or "
       "download it again");
}

void check_collada(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  const std::string fault =
      collada_fault({std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()});
  if (!fault.empty()) fail(path, fault);
}

// Metres per unit of a Collada file. It is read here, as in rviz. Assimp's root node, which holds
// its own conversion of unit and up-axis, is skipped, because that differs from version to version.
double collada_unit(const std::string& path) {
  tinyxml2::XMLDocument document;
  if (document.LoadFile(path.c_str()) != tinyxml2::XML_SUCCESS) return 1.0;  // assimp reports it
  const tinyxml2::XMLElement* root = document.FirstChildElement("COLLADA");
  const tinyxml2::XMLElement* asset = root != nullptr ? root->FirstChildElement("asset") : nullptr;
  const tinyxml2::XMLElement* unit = asset != nullptr ? asset->FirstChildElement("unit") : nullptr;
  const char* text = unit != nullptr ? unit->Attribute("meter") : nullptr;
  if (text == nullptr) return 1.0;
  std::istringstream stream(text);
  stream.imbue(std::locale::classic());
  double meter = 0.0;
  if (!(stream >> meter) || !std::isfinite(meter) || meter <= 0.0) {
    fail(path, "has <unit meter=\"" + std::string(text) +
                   "\">; it must be a number of metres > 0, such as 0.001 for millimetres");
  }
  return meter;
}

const aiScene& read_scene(const std::string& path, Assimp::Importer* importer) {
  // A Collada file's up-axis is not applied to links (REP 103 is Z up, and so rviz shows it).
  importer->SetPropertyBool(AI_CONFIG_IMPORT_COLLADA_IGNORE_UP_DIRECTION, true);
  importer->SetPropertyBool(AI_CONFIG_IMPORT_NO_SKELETON_MESHES, true);
  const aiScene* scene = nullptr;
  std::string reason;
  try {
    scene = importer->ReadFile(path, aiProcess_Triangulate | aiProcess_SortByPType);
    reason = importer->GetErrorString();
  } catch (const std::exception& error) {
    reason = error.what();
  }
  if (scene == nullptr || scene->mRootNode == nullptr) {
    fail(path, "cannot be read as a mesh (" + reason + "); STL, DAE and OBJ are known to work");
  }
  return *scene;
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
  MeshBuilder(const std::string& path, const Eigen::Vector3d& scale) : path_(path), scale_(scale) {}

  void add_node(const aiScene& scene, const aiNode& node, const Eigen::Affine3d& X_MP) {
    const Eigen::Affine3d X_MN = X_MP * to_eigen(node.mTransformation);
    for (unsigned i = 0; i < node.mNumMeshes; ++i) add_mesh(*scene.mMeshes[node.mMeshes[i]], X_MN);
    add_children(scene, node, X_MN);
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
    // A mirror reverses the corners' order; swapping two of them keeps outside outside.
    const bool mirrored = (scale_.prod() < 0.0) != (X_MN.linear().determinant() < 0.0);
    for (unsigned f = 0; f < mesh.mNumFaces; ++f) {
      const aiFace& face = mesh.mFaces[f];
      if (face.mNumIndices != 3) continue;
      TriangleMesh::Triangle triangle;
      for (unsigned k = 0; k < 3; ++k) {
        triangle[k] = vertex(mesh.mVertices[face.mIndices[k]], X_MN);
      }
      if (mirrored) std::swap(triangle[1], triangle[2]);
      mesh_.triangles.push_back(triangle);
    }
  }

  std::uint32_t vertex(const aiVector3D& v, const Eigen::Affine3d& X_MN) {
    const Eigen::Vector3d p = scale_.cwiseProduct(X_MN * Eigen::Vector3d(v.x, v.y, v.z));
    if (!p.allFinite()) {
      std::ostringstream text;
      text << "has a vertex at (" << p.transpose() << ") after its transforms and scale ("
           << scale_.transpose() << "); repair the mesh: coordinates must be finite";
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
  TriangleMesh mesh_;
  std::unordered_map<std::array<double, 3>, std::uint32_t, Hash> vertices_;
};

}  // namespace

TriangleMesh load_mesh(const std::string& path, const Eigen::Vector3d& scale) {
  check_scale(path, scale);
  check_file(path);
  check_end_of_stl(path);
  if (is_collada(path)) check_collada(path);
  Assimp::Importer importer;
  const aiScene& scene = read_scene(path, &importer);
  const Eigen::Affine3d X_MR = Eigen::Affine3d::Identity();
  TriangleMesh mesh;
  if (is_collada(path)) {
    // The root holds nothing but assimp's conversion of unit and up-axis.
    MeshBuilder builder(path, collada_unit(path) * scale);
    builder.add_children(scene, *scene.mRootNode, X_MR);
    mesh = builder.take();
  } else {
    MeshBuilder builder(path, scale);
    builder.add_node(scene, *scene.mRootNode, X_MR);
    mesh = builder.take();
  }
  if (mesh.triangles.empty()) {
    fail(path, "holds no triangle; export the surface as triangles or polygons");
  }
  orient_outward(&mesh);  // some exporters write meshes inside out
  return mesh;
}

}  // namespace ist
