#include "support/mesh_files.h"

#include <cstdint>
#include <cstring>
#include <sstream>

namespace ist::test {

std::string ascii_stl(const TriangleMesh& mesh) {
  std::ostringstream out;
  out.precision(9);
  out << "solid test\n";
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    out << "facet normal 0 0 0\nouter loop\n";
    for (int k = 0; k < 3; ++k) out << "vertex " << mesh.corner(t, k).transpose() << "\n";
    out << "endloop\nendfacet\n";
  }
  out << "endsolid test\n";
  return out.str();
}

std::string binary_stl(const TriangleMesh& mesh, std::string header) {
  const auto append = [](std::string* to, const auto& value) {
    char bytes[sizeof(value)];
    std::memcpy(bytes, &value, sizeof(value));
    to->append(bytes, sizeof(value));
  };
  header.resize(80, ' ');
  std::string out = header;
  append(&out, static_cast<std::uint32_t>(mesh.triangles.size()));
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (int i = 0; i < 3; ++i) append(&out, 0.0F);
    for (int k = 0; k < 3; ++k) {
      for (int i = 0; i < 3; ++i) append(&out, static_cast<float>(mesh.corner(t, k)[i]));
    }
    append(&out, std::uint16_t{0});
  }
  return out;
}

std::string obj(const TriangleMesh& mesh) {
  std::ostringstream out;
  out.precision(9);
  for (const Eigen::Vector3d& v : mesh.vertices) out << "v " << v.transpose() << "\n";
  for (const auto& [a, b, c] : mesh.triangles) {
    out << "f " << a + 1 << " " << b + 1 << " " << c + 1 << "\n";
  }
  return out.str();
}

std::string collada(const TriangleMesh& mesh, const ColladaOptions& options) {
  std::ostringstream positions, indices, out;
  positions.precision(9);
  for (const Eigen::Vector3d& v : mesh.vertices) positions << v.transpose() << " ";
  for (const auto& [a, b, c] : mesh.triangles) indices << a << " " << b << " " << c << " ";
  const std::size_t n = mesh.vertices.size();
  out << "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n"
         "<COLLADA xmlns=\"http://www.collada.org/2005/11/COLLADASchema\" version=\"1.4.1\">\n"
         "<asset>"
      << options.unit << "<up_axis>" << options.up_axis
      << "</up_axis></asset>\n"
         "<library_geometries><geometry id=\"g\"><mesh>\n<source id=\"p\"><float_array id=\"a\" "
         "count=\""
      << 3 * n << "\">" << positions.str()
      << "</float_array><technique_common>"
         "<accessor source=\"#a\" count=\""
      << n
      << "\" stride=\"3\"><param name=\"X\" "
         "type=\"float\"/><param name=\"Y\" type=\"float\"/><param name=\"Z\" type=\"float\"/>"
         "</accessor></technique_common></source>\n<vertices id=\"v\"><input semantic=\"POSITION\" "
         "source=\"#p\"/></vertices>\n<triangles count=\""
      << mesh.triangles.size() << "\"><input semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/><p>"
      << indices.str() << "</p></triangles>\n";
  if (options.with_line) {
    out << "<lines count=\"1\"><input semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/><p>0 1</p>"
           "</lines>\n";
  }
  out << "</mesh></geometry></library_geometries>\n<library_visual_scenes><visual_scene id=\"s\">"
         "<node id=\"n\">"
      << options.transform
      << "<instance_geometry url=\"#g\"/></node>"
         "</visual_scene></library_visual_scenes>\n<scene><instance_visual_scene "
         "url=\"#s\"/></scene>"
         "\n</COLLADA>\n";
  return out.str();
}

}  // namespace ist::test
