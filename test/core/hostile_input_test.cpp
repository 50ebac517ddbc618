// Files and texts from outside that are made to hang, to exhaust memory or to mislead: each is
// refused in bounded time, with a reason.

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "internal/geometry/limits.h"
#include "internal/geometry/mesh_io.h"
#include "internal/packing/packer.h"
#include "internal/packing/packing_cache.h"
#include "ist_proximity/geometry/error.h"
#include "ist_proximity/robot/kinematics.h"
#include "ist_proximity/robot/robot_description.h"
#include "ist_proximity/robot/robot_model.h"
#include "support/errors.h"
#include "support/mesh_files.h"
#include "support/meshes.h"
#include "support/sanitizers.h"
#include "support/temp_dir.h"

namespace ist {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

using test::error_of;
using test::expect_says;

std::string mesh_error(const std::string& path) {
  return error_of([&] { load_mesh(path); });
}

// [bytes] of memory that the process has held at most
std::size_t peak_memory() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::size_t>(usage.ru_maxrss) * 1024U;
}

class HostileFile : public testing::Test {
 protected:
  test::TempDir dir_;
};

// Opening a FIFO waits for a writer, reading a device never ends.
TEST_F(HostileFile, FifosAndDevicesAreRefusedAtOnce) {
  const auto start = Clock::now();
  const std::string fifo = dir_.file("pipe.stl");
  ASSERT_EQ(mkfifo(fifo.c_str(), 0600), 0);
  expect_says(mesh_error(fifo), "is no regular file but a FIFO, a device or a socket");
  const std::string device = dir_.file("zero.stl");
  fs::create_symlink("/dev/zero", device);
  expect_says(mesh_error(device), "is no regular file");
  fs::create_symlink("/dev/null", dir_.file("null.dae"));
  expect_says(mesh_error(dir_.file("null.dae")), "is no regular file");
  fs::create_symlink(dir_.file("loop.stl"), dir_.file("loop.stl"));
  expect_says(mesh_error(dir_.file("loop.stl")), "cannot be opened");
  EXPECT_LT(seconds_since(start), 1.0);
}

// An OBJ file may name a material file, which assimp would open.
TEST_F(HostileFile, AMaterialFileThatIsAFifoIsNotOpened) {
  ASSERT_EQ(mkfifo(dir_.file("pipe.mtl").c_str(), 0600), 0);
  const std::string path = dir_.write(
      "mesh.obj", "mtllib pipe.mtl\nusemtl x\n" + test::obj(test::box(Eigen::Vector3d::Ones())));
  const auto start = Clock::now();
  EXPECT_EQ(load_mesh(path).triangles.size(), 12U);
  EXPECT_LT(seconds_since(start), 1.0);
}

TEST_F(HostileFile, LargeFilesAreRefusedBeforeTheyAreRead) {
  const std::string path = dir_.write("large.stl", "solid");
  fs::resize_file(path, std::uintmax_t{1} << 40U);  // a hole: it takes no space
  const auto start = Clock::now();
  expect_says(mesh_error(path), "has 1099511627776 bytes; allowed are at most 268435456");
  EXPECT_LT(seconds_since(start), 1.0);
}

// Assimp takes memory for as many elements as a header announces.
TEST_F(HostileFile, HeadersThatAnnounceTooMuchAreRefused) {
  const std::size_t before = peak_memory();
  std::string stl(84, ' ');
  const std::uint32_t facets = 1000000000;
  std::memcpy(&stl[80], &facets, sizeof facets);
  expect_says(mesh_error(dir_.write("a.stl", stl)), "mesh file");
  const std::string ply =
      "ply\nformat ascii 1.0\nelement vertex 1000000000\nproperty float x\nproperty float y\n"
      "property float z\nelement face 1000000000\nproperty list uchar int vertex_indices\n"
      "end_header\n0 0 0\n";
  expect_says(mesh_error(dir_.write("a.ply", ply)),
              "announces 1e+09 elements 'vertex' in a file of");
  expect_says(mesh_error(dir_.write("a.off", "OFF\n# 1\n1000000000 1000000000 0\n0 0 0\n")),
              "announces 1e+09 vertices or faces");
  std::string nested = "<COLLADA><library_visual_scenes><visual_scene>";
  for (int i = 0; i < 200000; ++i) nested += "<node>";
  expect_says(mesh_error(dir_.write("a.dae", nested)), "nests its XML elements too deep");
  expect_says(mesh_error(dir_.write("a.gltf", std::string(1000000, '['))),
              "its name ends in '.gltf'; known are stl, dae, obj, ply, off");
  expect_says(mesh_error(dir_.write("a.ase", "*3DSMAX_ASCIIEXPORT 200\n")),
              "its name ends in '.ase'");
  if (!test::kSanitized) {
    EXPECT_LT(peak_memory() - before, std::size_t{200} << 20U);
  }
}

TEST_F(HostileFile, APackingCacheFileThatIsAFifoIsNotOpened) {
  ASSERT_EQ(mkfifo(dir_.file("key.istpack").c_str(), 0600), 0);
  const PackingCache cache(dir_.path().string());
  std::string warning;
  const auto start = Clock::now();
  EXPECT_FALSE(cache.load_unchecked("key", 1000, &warning).has_value());
  expect_says(warning, "is no regular file");
  fs::resize_file(dir_.write("large.istpack", "x"), std::uintmax_t{1} << 40U);
  EXPECT_FALSE(cache.load_unchecked("large", 1000, &warning).has_value());
  expect_says(warning, "allowed are at most");
  EXPECT_LT(seconds_since(start), 1.0);
}

TEST_F(HostileFile, ReadingAMeshCanBeCancelled) {
  const std::string path = dir_.write("fine.stl", test::binary_stl(test::icosphere(0.1, 6)));
  const std::string urdf =
      "<robot name='r'><link name='arm'><collision><geometry><mesh filename='" + path +
      "'/></geometry></collision></link></robot>";
  std::string link, mesh;
  const std::string error = error_of([&] {
    parse_urdf(urdf, GeometrySource::kCollision, {},
               [&](const std::string& of_link, const std::string& of_mesh) {
                 link = of_link;
                 mesh = of_mesh;
                 return false;
               });
  });
  expect_says(error, "was cancelled");
  EXPECT_EQ(link, "arm");
  EXPECT_EQ(mesh, path);
}

std::string chain(int links, const std::string& type, const std::string& content,
                  bool mimic = false) {
  std::string urdf = "<robot name='chain'><link name='l0'/>";
  for (int i = 1; i < links; ++i) {
    const std::string n = std::to_string(i);
    urdf += "<link name='l" + n + "'>" + content + "</link><joint name='j" + n + "' type='" + type +
            "'><parent link='l" + std::to_string(i - 1) + "'/><child link='l" + n +
            "'/><axis xyz='0 0 1'/><limit lower='-1' upper='1' effort='1' velocity='1'/>";
    if (mimic && i > 1) urdf += "<mimic joint='j" + std::to_string(i - 1) + "'/>";
    urdf += "</joint>";
  }
  return urdf + "</robot>";
}

double load_time(int links, bool mimic) {
  const std::string urdf = chain(links, "revolute", "", mimic);
  const auto start = Clock::now();
  const RobotDescription robot = parse_urdf(urdf, GeometrySource::kCollision, {});
  const Kinematics kinematics(robot);
  EXPECT_EQ(kinematics.bodies().size(), static_cast<std::size_t>(links));
  const auto model = build_robot_model(robot, {});
  EXPECT_NE(model, nullptr);
  if (mimic) {
    const std::size_t last = kinematics.find_joint("j" + std::to_string(links - 1)).value();
    EXPECT_EQ(kinematics.joints()[last].source, kinematics.find_joint("j1").value());
  }
  return seconds_since(start);
}

// A chain of 4,000 links took 27 s, of 2,000 mimic joints 14 s: time grew with the square.
TEST(HostileUrdf, LongChainsTakeTimeInProportion) {
  for (const bool mimic : {false, true}) {
    const double one = load_time(1000, mimic), four = load_time(4000, mimic);
    std::printf("1000 links %.3f s, 4000 links %.3f s\n", one, four);
    EXPECT_LT(four, 10.0 * one + 1.0);
    if (!test::kSanitized) {
      EXPECT_LT(four, 5.0);
    }
  }
}

std::string urdf_error(const std::string& urdf) {
  return error_of([&] { parse_urdf(urdf, GeometrySource::kCollision, {}); });
}

TEST(HostileUrdf, NumbersOfLinksAndElementsAreLimited) {
  expect_says(urdf_error(chain(5001, "fixed", "")), "has 5001 links; allowed are at most 5000");
  std::string elements;
  for (int i = 0; i < 20001; ++i) elements += "<collision><geometry/></collision>";
  expect_says(urdf_error("<robot name='r'><link name='l'>" + elements + "</link></robot>"),
              "more than 20000 elements with geometry; the limit is reached at link 'l'");
  expect_says(urdf_error(std::string(std::size_t{65} << 20U, 'x')), "allowed are at most 67108864");
}

// One faulty link must not write megabytes into every status_text.
TEST(HostileUrdf, ErrorsOfALinkStayReadable) {
  std::string elements;
  for (int i = 0; i < 5000; ++i) {
    elements += "<collision><geometry><sphere radius='-1'/></geometry></collision>";
  }
  elements += "<collision><geometry><mesh filename='" + std::string(100000, 'x') +
              "'/></geometry></collision>";
  const RobotDescription robot =
      parse_urdf("<robot name='r'><link name='l'>" + elements + "</link></robot>",
                 GeometrySource::kCollision, {});
  EXPECT_LT(robot.links[0].error.size(), 4000U);
  EXPECT_TRUE(robot.links[0].geometry.empty());
}

TEST(HostileUrdf, DeepNestingAndEntitiesAreRefusedOrHarmless) {
  std::string deep = "<robot name='r'><link name='l'/>";
  for (int i = 0; i < 100000; ++i) deep += "<a>";
  expect_says(urdf_error(deep), "not well-formed XML");
  std::string joint =
      "<robot name='r'><link name='l'/><link name='m'/><joint name='j' type='fixed'>"
      "<parent link='l'/><child link='m'/>";
  for (int i = 0; i < 90; ++i) joint += "<a>";
  for (int i = 0; i < 90; ++i) joint += "</a>";
  EXPECT_EQ(urdf_error(joint + "</joint></robot>"), "(no error)");
  const std::string laughs =
      "<!DOCTYPE x [<!ENTITY a 'ha'><!ENTITY b '&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;'>"
      "<!ENTITY c '&b;&b;&b;&b;&b;&b;&b;&b;&b;&b;'>]><robot name='r&c;'><link name='l'/></robot>";
  const auto start = Clock::now();
  urdf_error(laughs);  // entities of one's own are not replaced
  EXPECT_LT(seconds_since(start), 1.0);
}

TEST(HostileUrdf, NamesWithControlCharactersAreRefused) {
  const auto with_name = [](const std::string& name) {
    return urdf_error("<robot name='r'><link name='" + name + "'/></robot>");
  };
  expect_says(with_name("a\x1b[2J"), "holds the control character 27 at byte 1");
  expect_says(with_name("a&#10;b"), "holds the control character 10");
  expect_says(with_name("a\xff"), "is no UTF-8 from byte 1 on");
  expect_says(with_name("\xc0\xaf"), "is no UTF-8");
  expect_says(with_name(std::string(257, 'a')), "has 257 bytes; allowed are at most 256");
  EXPECT_EQ(with_name("\xc3\xa4rm \xe2\x82\xac"), "(no error)");
  expect_says(urdf_error("<robot name='r\x07'><link name='l'/></robot>"), "control character 7");
}

// A rod of 1 cm by 10 km took 9.4 GB: its surface was divided without end.
TEST(HostileShape, PackingALongRodIsBounded) {
  PackingConfig config;
  config.max_spheres = 1000;
  const std::size_t before = peak_memory();
  for (const PackingOrder order : {PackingOrder::kMedial, PackingOrder::kDisjoint}) {
    config.order = order;
    const auto start = Clock::now();
    const Packing packing = pack_element(Cylinder{0.005, 1e4}, config,
                                         [&](double) { return seconds_since(start) < 2.0; });
    EXPECT_FALSE(packing.certificate.reached);
    EXPECT_LE(packing.spheres.size(), 1000U);
    std::printf("%.1f s, %.0f MB\n", seconds_since(start),
                1e-6 * static_cast<double>(peak_memory() - before));
  }
  if (!test::kSanitized) {
    EXPECT_LT(peak_memory() - before, std::size_t{500} << 20U);
  }
}

// Every phase of packing asks whether to go on; the longest took 60 s without asking. A request to
// stop comes at different times of the work on a mesh with many holes.
TEST(HostileShape, PackingStopsSoonWhereverItIs) {
  TriangleMesh mesh = test::icosphere(0.5, 6);
  TriangleMesh holes;
  holes.vertices = mesh.vertices;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    if (t % 5 != 0) holes.triangles.push_back(mesh.triangles[t]);
  }
  PackingConfig config;
  config.max_error = 0.001;
  double longest = 0.0;
  for (const PackingOrder order : {PackingOrder::kMedial, PackingOrder::kDisjoint}) {
    config.order = order;
    for (const double stop_after : {0.02, 0.1, 0.3, 1.0, 2.0}) {
      const auto start = Clock::now();
      auto last = start, stopped = start;
      const Packing packing = pack_mesh(holes, config, [&](double) {
        const auto now = Clock::now();
        longest = std::max(longest, std::chrono::duration<double>(now - last).count());
        last = stopped = now;
        return seconds_since(start) < stop_after;
      });
      longest = std::max(longest, seconds_since(stopped));
      EXPECT_FALSE(packing.certificate.reached);
      EXPECT_FALSE(packing.spheres.empty());
    }
  }
  std::printf("longest time without asking, or after a stop: %.0f ms\n", 1e3 * longest);
  if (!test::kSanitized) {
    EXPECT_LT(longest, 2.0) << "it is about 0.05 s where the machine is not busy";
  }
}

}  // namespace
}  // namespace ist
