#include "internal/geometry/mesh_io.h"

#include <gtest/gtest.h>

#include <cctype>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "support/data_dir.h"
#include "support/errors.h"
#include "support/mesh_files.h"
#include "support/meshes.h"
#include "support/temp_dir.h"

namespace ist {
namespace {

using test::ascii_stl;
using test::binary_stl;
using test::bounds;
using test::collada;
using test::ColladaOptions;
using test::expect_says;
using test::obj;
using test::open_edges;
using test::signed_volume;

// A box off the origin, so that rotations, mirrors and scales all have an effect.
const Eigen::Vector3d kMin(0.1, -0.2, 0.3), kMax(0.2, 0.1, 0.7);

TriangleMesh sample_box() {
  TriangleMesh mesh = test::box(kMax - kMin);
  for (Eigen::Vector3d& v : mesh.vertices) v += 0.5 * (kMin + kMax);
  return mesh;
}

void expect_box(const TriangleMesh& mesh, const Eigen::Vector3d& min = kMin,
                const Eigen::Vector3d& max = kMax) {
  EXPECT_EQ(mesh.triangles.size(), 12U);
  EXPECT_EQ(mesh.vertices.size(), 8U) << "equal vertices were not merged";
  EXPECT_TRUE(bounds(mesh).min().isApprox(min, 1e-6)) << bounds(mesh).min().transpose();
  EXPECT_TRUE(bounds(mesh).max().isApprox(max, 1e-6)) << bounds(mesh).max().transpose();
  EXPECT_EQ(open_edges(mesh), 0U);
  EXPECT_NEAR(signed_volume(mesh), (max - min).prod(), 1e-6 * (max - min).prod());
}

std::string error_of(const std::string& path, const Eigen::Vector3d& scale = {1, 1, 1}) {
  const std::string error = test::error_of([&] { load_mesh(path, scale); });
  expect_says(error, path);
  return error;
}

class MeshIo : public testing::Test {
 protected:
  TriangleMesh load(const std::string& name, const std::string& content,
                    const Eigen::Vector3d& scale = {1, 1, 1}) {
    return load_mesh(dir_.write(name, content), scale);
  }
  TriangleMesh load(const ColladaOptions& options) {
    return load("mesh.dae", collada(sample_box(), options));
  }

  test::TempDir dir_;
};

TEST_F(MeshIo, readsStlObjAndCollada) {
  expect_box(load("mesh.stl", ascii_stl(sample_box())));
  expect_box(load("mesh.stl", binary_stl(sample_box())));
  expect_box(load("MESH.STL", binary_stl(sample_box())));
  expect_box(load("mesh.obj", obj(sample_box())));
  expect_box(load("mesh.dae", collada(sample_box())));
}

TEST_F(MeshIo, triangulatesPolygons) {
  const TriangleMesh mesh =
      load("mesh.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0.5 0.7 0\nf 1 2 3 5 4\n");
  EXPECT_EQ(mesh.triangles.size(), 3U);
  EXPECT_NEAR(test::surface_area(mesh), 0.85, 1e-6);  // the concave corner is cut out
}

TEST_F(MeshIo, appliesTheColladaUnit) {
  ColladaOptions options;
  const Eigen::Vector3d shift(1, 2, 3);
  options.transform = "<translate>1 2 3</translate>";
  for (const auto& [unit, meter] : std::initializer_list<std::pair<const char*, double>>{
           {"<unit name=\"inch\" meter=\"0.0254\"/>", 0.0254},
           {"<unit name=\"millimeter\" meter=\"0.001\"/>", 0.001},
           {"<unit name=\"meter\"/>", 1.0},
           {"", 1.0}}) {
    options.unit = unit;
    expect_box(load(options), meter * (kMin + shift), meter * (kMax + shift));
  }
}

TEST_F(MeshIo, saysWhatIsWrongWithAColladaUnit) {
  for (const char* meter : {"0", "-1", "inch", "nan"}) {
    ColladaOptions options;
    options.unit = std::string("<unit meter=\"") + meter + "\"/>";
    expect_says(error_of(dir_.write("mesh.dae", collada(sample_box(), options))),
                std::string("<unit meter=\"") + meter + "\">");
  }
}

// Assimp rotates Z_UP and X_UP files to Y_UP at the root node, which would put every link at 90
// degrees to its appearance in rviz.
TEST_F(MeshIo, ignoresTheColladaUpAxis) {
  for (const char* axis : {"X_UP", "Y_UP", "Z_UP"}) {
    ColladaOptions options;
    options.up_axis = axis;
    expect_box(load(options));
  }
}

TEST_F(MeshIo, appliesNodeTransforms) {
  ColladaOptions options;
  options.transform = "<translate>1 0 0</translate><rotate>0 0 1 90</rotate>";
  expect_box(load(options), Eigen::Vector3d(1.0 - kMax.y(), kMin.x(), kMin.z()),
             Eigen::Vector3d(1.0 - kMin.y(), kMax.x(), kMax.z()));
}

TEST_F(MeshIo, dropsLinesAmongTriangles) {
  ColladaOptions options;
  options.with_line = true;
  expect_box(load(options));
}

TEST_F(MeshIo, scales) {
  expect_box(load("mesh.stl", binary_stl(sample_box()), {0.001, 0.002, 0.003}),
             kMin.cwiseProduct(Eigen::Vector3d(0.001, 0.002, 0.003)),
             kMax.cwiseProduct(Eigen::Vector3d(0.001, 0.002, 0.003)));
}

// An open mesh: only the sign of the mirroring scale can correct its orientation.
TEST_F(MeshIo, keepsOutsideOutsideUnderMirrors) {
  const TriangleMesh open = test::open_box({0.3, 0.2, 0.1});
  const double volume = signed_volume(open);
  ASSERT_GT(volume, 0.0);
  EXPECT_NEAR(signed_volume(load("m.stl", binary_stl(open), {1, -1, 1})), volume, 1e-8);
  EXPECT_NEAR(signed_volume(load("m.stl", binary_stl(open), {-1, -1, 1})), volume, 1e-8);
  EXPECT_NEAR(signed_volume(load("m.stl", binary_stl(open), {-1, -1, -1})), volume, 1e-8);

  ColladaOptions options;
  options.transform = "<scale>-1 1 1</scale>";
  const std::string mirrored = collada(open, options);
  EXPECT_NEAR(signed_volume(load("m.dae", mirrored)), volume, 1e-8);
  EXPECT_NEAR(signed_volume(load("m.dae", mirrored, {1, 1, -1})), volume, 1e-8);
}

TEST_F(MeshIo, turnsClosedMeshesThatAreInsideOut) {
  expect_box(load("mesh.stl", binary_stl(test::inside_out(sample_box()))));
  // An open mesh has no certain outside.
  const TriangleMesh open = test::inside_out(test::open_box({0.3, 0.2, 0.1}));
  EXPECT_LT(signed_volume(load("mesh.stl", binary_stl(open))), 0.0);
  // A shell that is inside out within another shell is a cavity.
  const TriangleMesh hollow =
      test::joined(test::box({0.3, 0.3, 0.3}), test::inside_out(test::box({0.1, 0.1, 0.1})));
  EXPECT_NEAR(signed_volume(load("mesh.stl", binary_stl(hollow))), 0.027 - 0.001, 1e-8);
}

TEST_F(MeshIo, keepsDuplicatedAndDegenerateFaces) {
  TriangleMesh mesh = sample_box();
  mesh.triangles.push_back(mesh.triangles.front());
  mesh.triangles.push_back({0, 1, 1});
  EXPECT_EQ(load("mesh.stl", binary_stl(mesh)).triangles.size(), 14U);
}

TEST_F(MeshIo, saysWhatIsWrongWithAFile) {
  expect_says(error_of(dir_.file("none.stl")), "does not exist");
  expect_says(error_of(dir_.path().string()), "is a directory");
  expect_says(error_of(dir_.write("empty.stl", "")), "empty (0 bytes)");
  expect_says(error_of(dir_.write("mesh.txt", "hello")), "cannot be read as a mesh");
  expect_says(error_of(dir_.write("mesh.dae", "<COLLADA")), "cannot be read as a mesh");
  const std::string whole = binary_stl(sample_box());
  expect_says(error_of(dir_.write("cut.stl", whole.substr(0, whole.size() - 60))), "cut off");
}

// A truncated file, after a broken download or on a full disk, is rejected: a part of the link
// would be missing.
TEST_F(MeshIo, refusesAnAsciiStlThatIsCutOff) {
  const std::string whole = ascii_stl(sample_box());
  for (std::size_t size = 80; size < whole.size() - std::string("endsolid test\n").size(); ++size) {
    const std::string error = error_of(dir_.write("cut.stl", whole.substr(0, size)));
    ASSERT_NE(error.find("cut off"), std::string::npos) << size << ": " << error;
  }
  const std::string two = whole + whole.substr(0, whole.size() / 2);
  expect_says(error_of(dir_.write("cut.stl", two)), "cut off");
  const std::string binary = binary_stl(sample_box(), "solid binary");
  expect_says(error_of(dir_.write("cut.stl", binary.substr(0, binary.size() - 60))), "cut off");
}

// Some programs begin the header with "solid", some write a line after the facets. What could hold
// a facet more is refused: it might be one.
TEST_F(MeshIo, readsBinaryStlWithAFewBytesMore) {
  for (const std::string header : {"", "solid exported by a CAD program"}) {
    const std::string whole = binary_stl(sample_box(), header);
    for (const std::size_t more : {0U, 1U, 2U, 49U}) {
      expect_box(load("mesh.stl", whole + std::string(more, '\n')));
    }
    const std::string error = error_of(dir_.write("more.stl", whole + std::string(50, '\n')));
    expect_says(error, "announces 12 facets, which take 684 bytes, and has 734");
  }
}

// Exporters leave such groups where a material has no faces. Assimp ends the program at some.
TEST_F(MeshIo, readsColladaWithEmptyGroups) {
  const std::string whole = test::collada(sample_box());
  for (const std::string name :
       {"triangles", "lines", "polylist", "polygons", "tristrips", "trifans", "linestrips"}) {
    for (const char* lists : {"", "<p/>", "<p></p>", "<vcount></vcount><p> </p>"}) {
      SCOPED_TRACE(name + lists);
      std::string text = whole;
      text.insert(text.find("<triangles"),
                  "<" + name + " count=\"0\">" + lists + "</" + name + ">");
      expect_box(load("mesh.dae", text));
    }
  }
}

TEST_F(MeshIo, readsAsciiStlHoweverItEnds) {
  const std::string whole = ascii_stl(sample_box());
  const std::string body = whole.substr(0, whole.rfind("endsolid"));
  for (const char* end :
       {"endsolid", "end solid", "endsolid vertex cover", "ENDSOLID test\n\n", "  endsolid\r\n"}) {
    expect_box(load("mesh.stl", body + end));
  }
  std::string dos, capitals;
  for (const char c : whole) {
    dos += c == '\n' ? "\r\n" : std::string(1, c);
    capitals += static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  }
  expect_box(load("mesh.stl", dos));
  expect_box(load("mesh.stl", capitals));
  EXPECT_EQ(load("mesh.stl", whole + whole).triangles.size(), 24U);
  EXPECT_EQ(load("mesh.stl", whole + body + "endsolid " + std::string(3000, 'x')).triangles.size(),
            24U);
}

TEST_F(MeshIo, saysWhenThereIsNoTriangle) {
  const TriangleMesh none;
  for (const auto& [name, content] : std::initializer_list<std::pair<std::string, std::string>>{
           {"none.stl", ascii_stl(none)},
           {"zero.stl", binary_stl(none)},
           {"points.obj", "v 0 0 0\nv 1 0 0\n"},
           {"line.obj", "v 0 0 0\nv 1 0 0\nl 1 2\n"}}) {
    const std::string text = error_of(dir_.write(name, content));
    EXPECT_TRUE(text.find("no triangle") != std::string::npos ||
                text.find("cannot be read") != std::string::npos)
        << text;
  }
}

TEST_F(MeshIo, refusesNonFiniteVertices) {
  TriangleMesh mesh = sample_box();
  for (const double bad : {std::nan(""), std::numeric_limits<double>::infinity()}) {
    mesh.vertices[3].y() = bad;
    expect_says(error_of(dir_.write("bad.stl", binary_stl(mesh))), "must be finite");
  }
  mesh.vertices[3].y() = 3e38;
  expect_says(error_of(dir_.write("big.stl", binary_stl(mesh)), {1e300, 1e300, 1e300}),
              "must be finite");
}

TEST_F(MeshIo, printsNothing) {
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  error_of(dir_.write("mesh.dae", "<COLLADA"));
  error_of(dir_.write("mesh.dae", "<COLLADA><library_geometries/></COLLADA>"));
  error_of(dir_.write("mesh.obj", "mtllib none.mtl\nv 0 0\nf 1 2 3\n"));
  error_of(dir_.file("none.stl"));
  EXPECT_EQ(testing::internal::GetCapturedStdout(), "");
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

// The visual meshes of a real robot: line primitives among the triangles, Z_UP, many nodes. The
// collision meshes are coarse hulls of the same links in the same frames.
TEST(MeshIoPanda, visualMeshesMatchTheirCollisionMeshes) {
  const auto data = test::data_dir();
  if (!data) GTEST_SKIP() << test::kNoData;
  const std::string meshes = test::franka_package(*data) + "/meshes/";
  for (const char* name :
       {"link0", "link1", "link2", "link3", "link4", "link5", "link6", "link7", "hand"}) {
    const TriangleMesh visual = load_mesh(meshes + "visual/" + name + ".dae");
    const TriangleMesh collision = load_mesh(meshes + "collision/" + name + ".stl");
    EXPECT_GT(visual.triangles.size(), 7000U) << name;
    const Eigen::AlignedBox3d a = bounds(visual), b = bounds(collision);
    EXPECT_LT((a.min() - b.min()).cwiseAbs().maxCoeff(), 0.006) << name;
    EXPECT_LT((a.max() - b.max()).cwiseAbs().maxCoeff(), 0.006) << name;
    EXPECT_GT(signed_volume(visual), 0.0) << name;
    EXPECT_GT(signed_volume(collision), 0.0) << name;
  }
}

}  // namespace
}  // namespace ist
