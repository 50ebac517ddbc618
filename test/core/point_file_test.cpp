#include "facade/point_file.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "support/errors.h"
#include "support/scene.h"
#include "support/temp_dir.h"

namespace ist {
namespace {

const std::vector<Eigen::Vector3f> kPoints = {
    {0.5F, -1.25F, 3.0F}, {NAN, NAN, NAN}, {1e-3F, 2.5F, -7.0F}, {4.0F, 5.0F, 6.0F}};

template <class T>
void append(T value, bool is_big_endian, std::string* bytes) {
  char raw[sizeof(T)];
  std::memcpy(raw, &value, sizeof(T));
  for (std::size_t i = 0; i < sizeof(T); ++i) {
    bytes->push_back(raw[is_big_endian ? sizeof(T) - 1 - i : i]);
  }
}

/// Fields: an integer label, x, y and z in float32, three more numbers.
std::string pcd_header(const std::string& encoding) {
  return "# .PCD v0.7\nVERSION 0.7\nFIELDS label x y z extra\nSIZE 2 4 4 4 8\nTYPE U F F F F\n"
         "COUNT 1 1 1 1 3\nWIDTH 2\nHEIGHT 2\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 4\nDATA " +
         encoding + "\n";
}

// The points as lines, between what stands before and after each of them.
std::string lines(const std::string& before, const std::string& after) {
  std::ostringstream text;
  text.precision(9);
  for (const Eigen::Vector3f& p : kPoints) {
    text << before << p.x() << " " << p.y() << " " << p.z() << after << "\n";
  }
  return text.str();
}

std::string pcd(const std::string& encoding) {
  std::string bytes = pcd_header(encoding);
  if (encoding == "ascii") return bytes + lines("7 ", " 1 2 3");
  if (encoding == "binary") {
    for (const Eigen::Vector3f& p : kPoints) {
      append(std::uint16_t{7}, false, &bytes);
      for (int k = 0; k < 3; ++k) append(p[k], false, &bytes);
      for (int k = 0; k < 3; ++k) append(1.5, false, &bytes);
    }
    return bytes;
  }
  std::string data;
  for (std::size_t i = 0; i < kPoints.size(); ++i) append(std::uint16_t{7}, false, &data);
  for (int k = 0; k < 3; ++k) {
    for (const Eigen::Vector3f& p : kPoints) append(p[k], false, &data);
  }
  const std::size_t plain = data.size();
  // Zeros that are told by one byte and a back reference to it.
  const std::size_t zeros = kPoints.size() * 3 * 8;
  std::string packed;
  for (std::size_t at = 0; at < plain; at += 32) {
    const std::string part = data.substr(at, 32);
    packed.push_back(static_cast<char>(part.size() - 1));
    packed += part;
  }
  packed += std::string("\x00\x00", 2);
  packed.push_back(static_cast<char>(7U << 5U));
  packed.push_back(static_cast<char>(zeros - 1 - 9));
  packed.push_back('\0');
  append(static_cast<std::uint32_t>(packed.size()), false, &bytes);
  append(static_cast<std::uint32_t>(plain + zeros), false, &bytes);
  return bytes + packed;
}

std::string ply(const std::string& encoding) {
  std::string bytes = "ply\nformat " + encoding +
                      " 1.0\ncomment made by a test\nelement camera 1\nproperty int number\n"
                      "property list uchar short sizes\nelement vertex 4\nproperty uchar red\n"
                      "property float x\nproperty double y\nproperty float z\n"
                      "element face 0\nproperty list uchar int vertex_indices\nend_header\n";
  if (encoding == "ascii") return bytes + "3\n2 640 480\n" + lines("255 ", "");
  const bool is_big_endian = encoding == "binary_big_endian";
  append(std::int32_t{3}, is_big_endian, &bytes);
  append(std::uint8_t{2}, is_big_endian, &bytes);
  append(std::int16_t{640}, is_big_endian, &bytes);
  append(std::int16_t{480}, is_big_endian, &bytes);
  for (const Eigen::Vector3f& p : kPoints) {
    append(std::uint8_t{255}, is_big_endian, &bytes);
    append(p.x(), is_big_endian, &bytes);
    append(static_cast<double>(p.y()), is_big_endian, &bytes);
    append(p.z(), is_big_endian, &bytes);
  }
  return bytes;
}

std::string parse(const std::string& bytes, PointFile* file) {
  return bytes.compare(0, 3, "ply") == 0 ? parse_ply(bytes, file) : parse_pcd(bytes, file);
}

std::vector<std::string> all_formats() {
  return {pcd("ascii"),
          pcd("binary"),
          pcd("binary_compressed"),
          ply("ascii"),
          ply("binary_little_endian"),
          ply("binary_big_endian")};
}

TEST(PointFile, EveryFormatGivesThePoints) {
  for (const std::string& bytes : all_formats()) {
    SCOPED_TRACE(bytes.substr(0, 60));
    PointFile file;
    ASSERT_EQ(parse(bytes, &file), "");
    ASSERT_EQ(file.points.size(), kPoints.size());
    EXPECT_EQ(file.width * file.height, kPoints.size());
    for (std::size_t i = 0; i < kPoints.size(); ++i) {
      for (int k = 0; k < 3; ++k) {
        if (std::isnan(kPoints[i][k])) {
          EXPECT_TRUE(std::isnan(file.points[i][k]));
        } else {
          EXPECT_EQ(static_cast<float>(file.points[i][k]), kPoints[i][k]);
        }
      }
    }
  }
}

std::string with_viewpoint(const std::string& viewpoint) {
  std::string bytes = pcd("ascii");
  const std::string none = "0 0 0 1 0 0 0";
  return bytes.replace(bytes.find(none), none.size(), viewpoint);
}

// The camera is at (1, 2, 3), turned by 90 degrees about z.
TEST(PointFile, PointsArePlacedByTheViewpoint) {
  const test::TempDir folder;
  const PointFile file =
      read_points(folder.write("turned.pcd", with_viewpoint("1 2 3 0.70710678 0 0 0.70710678")));
  ASSERT_EQ(file.points.size(), kPoints.size());
  const Eigen::Vector3d p = kPoints[0].cast<double>();
  EXPECT_LT((file.points[0] - Eigen::Vector3d(1.0 - p.y(), 2.0 + p.x(), 3.0 + p.z())).norm(), 1e-7);
  for (const char* wrong : {"0 0 0 0 0 0 0", "nan 0 0 1 0 0 0", "0 0 0 1", "1e9 0 0 1 0 0 0",
                            "0 0 0 2 0 0 0", "0 0 x 1 0 0 0"}) {
    PointFile none;
    test::expect_says(parse(with_viewpoint(wrong), &none), "VIEWPOINT");
  }
}

// From the camera, the points are 3.29, 7.43 and 8.77 m away; from the origin of the frame in which
// the VIEWPOINT is stated, 5 to 15 m.
TEST(PointFile, RangesCountFromTheViewpoint) {
  const test::TempDir folder;
  const std::string path = folder.write("far.pcd", with_viewpoint("0 0 9 1 0 0 0"));
  ObstaclesConfig config;
  config.max_range = 5.0;
  EXPECT_EQ(Obstacles::from_file(path, config).size(), 1U);
  config.min_range = 3.0;
  config.max_range = 8.0;
  EXPECT_EQ(Obstacles::from_file(path, config).size(), 2U);
}

// What a file says beside its points is used or refused by name: points that are dropped are free
// space, a surface is not its corners, and a laser's driver that writes whole numbers counts in
// millimetres: no wall is at 400 m.
TEST(PointFile, WhatIsNotUnderstoodIsRefused) {
  struct Case {
    std::string bytes, from, to, what;
  };
  const std::string more = "7 0.1 0.1 0.1 1 2 3\n";
  const std::string point(8 + 3 * 8 + 4 + 2, '\0'),
      surface = "Sample the surface", face = "face 0\nproperty list uchar int vertex_indices";
  for (const auto& [bytes, from, to, what] : std::initializer_list<Case>{
           {pcd("ascii") + more, "", "", "holds more"},
           {pcd("binary") + point, "", "", "holds more"},
           {ply("ascii") + "255 0.1 0.1 0.1\n", "", "", "holds more"},
           {ply("binary_little_endian") + point, "", "", "holds more"},
           {pcd("ascii"), "WIDTH 2", "UNITS mm\nWIDTH 2", "'UNITS'"},
           {pcd("ascii"), "WIDTH 2", "WIDTH 1\nWIDTH 2", "two lines WIDTH"},
           {pcd("ascii"), "WIDTH 2", "WIDTH 99999999", "WIDTH"},
           {pcd("ascii"), "7 0.5", "7 a.b", "point 0"},
           {pcd("ascii"), "VIEWPOINT", "viewpoint", "'viewpoint'"},
           {pcd("ascii"), "U F F F", "U I F F", "whole numbers"},
           {ply("ascii"), "property float x", "property int x", "whole numbers"},
           {ply("ascii"), "property double y", "property int y", "whole numbers"},
           {ply("ascii") + "3 0 1 2\n", "face 0", "face 1", surface},
           {ply("ascii") + "3 0 1 2\n", "face 0", "tristrips 1", surface},
           {ply("ascii") + "1 0\n", face, "polygon 1\nproperty list uchar int vertex_index",
            surface},
           {ply("ascii") + "1 0\n", face, "edge 1\nproperty int vertex1", surface},
           {ply("ascii"), "element camera", "element vertex", "more than one element"},
           {ply("ascii"), "2 640", "-2 640", "damaged in its element 'camera'"}}) {
    std::string changed = bytes;
    changed.replace(changed.find(from), from.size(), to);
    PointFile file;
    test::expect_says(parse(changed, &file), what);
  }
}

// A file that is cut off anywhere is refused, or is complete; nothing is read beyond its end.
TEST(PointFile, CutOffFilesAreRefused) {
  for (const std::string& bytes : all_formats()) {
    for (std::size_t size = 0; size + 2 < bytes.size(); ++size) {
      PointFile file;
      const std::string problem = parse(bytes.substr(0, size), &file);
      EXPECT_NE(problem, "") << size << " of " << bytes.size() << " bytes of "
                             << bytes.substr(0, 60);
    }
  }
}

TEST(PointFile, DamagedFilesAreRefusedOrRead) {
  test::Rng rng(1);
  int refused = 0;
  for (const std::string& bytes : all_formats()) {
    for (int i = 0; i < 2000; ++i) {
      std::string damaged = bytes;
      const auto at = std::uniform_int_distribution<std::size_t>(0, bytes.size() - 1)(rng);
      damaged[at] = static_cast<char>(std::uniform_int_distribution<int>(0, 255)(rng));
      PointFile file;
      const bool is_refused = !parse(damaged, &file).empty();
      refused += is_refused ? 1 : 0;
      if (!is_refused) EXPECT_EQ(file.points.size(), file.width * file.height);
    }
  }
  EXPECT_GT(refused, 1000);
}

TEST(PointFile, MessagesNameFileAndFault) {
  const test::TempDir folder;
  const auto message = [&](const std::string& name, const std::string& bytes) {
    std::ofstream(folder.file(name), std::ios::binary) << bytes;
    return test::error_of([&] { read_points(folder.file(name)); });
  };
  std::string no_z = pcd("ascii");
  no_z.replace(no_z.find("x y z"), 5, "x y u");
  test::expect_says(message("a.pcd", no_z), "a.pcd' has no field z");
  test::expect_says(message("b.PCD", pcd("binary").substr(0, 250)), "is cut off");
  test::expect_says(message("c.ply", "solid x"), "is no PLY file");
  test::expect_says(message("d.xyz", "1 2 3"), "extension");
  test::expect_says(test::error_of([&] { read_points(folder.file("none.pcd")); }), "none.pcd");
  ASSERT_EQ(mkfifo(folder.file("fifo.ply").c_str(), 0600), 0);
  test::expect_says(test::error_of([&] { read_points(folder.file("fifo.ply")); }), "fifo.ply");
}

}  // namespace
}  // namespace ist
