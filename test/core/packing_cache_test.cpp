#include "internal/packing/packing_cache.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <tuple>
#include <utility>
#include <vector>

#include "support/accuracy.h"
#include "support/environment.h"
#include "support/errors.h"
#include "support/meshes.h"
#include "support/temp_dir.h"

namespace ist {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kManySpheres = 1000000;
const std::string kKey = "0123456789abcdef0123456789abcdef";

Packing sample_packing() {
  Packing packing;
  for (int i = 0; i < 12; ++i) {
    packing.spheres.push_back({{0.1 * i, -1.0 / (i + 1), 1e-9 * i}, 0.01 * i, 0.01 * i + 0.003});
  }
  packing.certificate = {0.003, 0.001, 0.002, 1e-4, 0.5, true};
  return packing;
}

void expect_equal(const Packing& a, const Packing& b) {
  ASSERT_EQ(a.spheres.size(), b.spheres.size());
  for (std::size_t i = 0; i < a.spheres.size(); ++i) {
    EXPECT_EQ(a.spheres[i].center, b.spheres[i].center);
    EXPECT_EQ(a.spheres[i].radius, b.spheres[i].radius);
    EXPECT_EQ(a.spheres[i].cover_radius, b.spheres[i].cover_radius);
  }
  const auto numbers = [](const PackingCertificate& c) {
    return std::make_tuple(c.max_gap, c.mean_gap, c.interior_gap, c.unreachable_area,
                           c.surface_area, c.reached);
  };
  EXPECT_EQ(numbers(a.certificate), numbers(b.certificate));
}

class PackingCacheTest : public testing::Test {
 protected:
  PackingCacheTest() : cache_(dir_.file("deep/cache")) {}

  // What is stored; warning_ says why there is none.
  std::optional<Packing> load(const PackingCache& cache) {
    warning_.clear();
    return cache.load_unchecked(kKey, kManySpheres, &warning_);
  }

  // Stores the packing and returns its file's name; the folder holds no other file.
  fs::path store(const Packing& packing) {
    EXPECT_TRUE(cache_.store(kKey, packing, &warning_));
    EXPECT_EQ(warning_, "");
    std::vector<fs::path> files;
    for (const auto& entry : fs::directory_iterator(dir_.file("deep/cache"))) {
      files.push_back(entry.path());
    }
    EXPECT_EQ(files.size(), 1U);
    return files.front();
  }

  void expect_refused(const fs::path& file, const std::string& bytes, const std::string& why) {
    fs::remove(file);  // file systems flush a file that is truncated: 5 ms each
    std::ofstream(file, std::ios::binary) << bytes;
    EXPECT_FALSE(load(cache_)) << why;
    test::expect_says(warning_, file.string());
    test::expect_says(warning_, why);
  }

  test::TempDir dir_;
  PackingCache cache_;
  std::string warning_;
};

TEST_F(PackingCacheTest, returnsTheStoredPacking) {
  store(sample_packing());
  const auto loaded = load(cache_);
  ASSERT_TRUE(loaded) << warning_;
  expect_equal(*loaded, sample_packing());
  EXPECT_EQ(warning_, "");
}

// A writer that is killed leaves its temporary file, which nothing ever read or removed.
TEST_F(PackingCacheTest, storingRemovesWhatKilledWritersHaveLeft) {
  const fs::path folder = store(sample_packing()).parent_path();
  const auto now = fs::file_time_type::clock::now();
  const auto add = [&](const std::string& name, std::chrono::minutes age) {
    std::ofstream(folder / name) << "cut off";
    fs::last_write_time(folder / name, now - age);
  };
  using std::chrono::minutes;
  add(kKey + ".istpack.4711.0.1700000000.tmp", minutes(61));
  add("another.istpack.4711.1.1700000000.tmp", minutes(60 * 24 * 400));
  add(kKey + ".istpack.4712.0.1700000001.tmp", minutes(55));  // may still be written
  add("notes.tmp", minutes(60 * 24));                         // not ours
  add("another.istpack", minutes(60 * 24));
  fs::create_directory(folder / "a.istpack.b.tmp");
  fs::last_write_time(folder / "a.istpack.b.tmp", now - minutes(61));
  EXPECT_TRUE(cache_.store(kKey, sample_packing(), &warning_)) << warning_;
  std::set<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder)) {
    names.insert(entry.path().filename().string());
  }
  const std::set<std::string> expected = {kKey + ".istpack",
                                          kKey + ".istpack.4712.0.1700000001.tmp", "notes.tmp",
                                          "another.istpack", "a.istpack.b.tmp"};
  EXPECT_EQ(names, expected);
}

TEST_F(PackingCacheTest, anAbsentFileIsNoWarning) {
  EXPECT_FALSE(load(cache_));
  EXPECT_EQ(warning_, "");
}

TEST_F(PackingCacheTest, noDirectoryTurnsItOff) {
  const PackingCache off("");
  EXPECT_TRUE(off.store(kKey, sample_packing(), &warning_));
  EXPECT_EQ(warning_, "");
  EXPECT_FALSE(load(off));
  EXPECT_EQ(warning_, "");
  EXPECT_FALSE(fs::exists(kKey + ".istpack"));
}

TEST_F(PackingCacheTest, refusesEveryTruncation) {
  const fs::path file = store(sample_packing());
  const std::string whole = test::read_text(file);
  for (std::size_t size = 0; size < whole.size(); ++size) {
    expect_refused(file, whole.substr(0, size), "not used");
  }
  expect_refused(file, whole + '\0', "not used");
  expect_refused(file, whole + whole, "not used");
}

TEST_F(PackingCacheTest, refusesEveryFlippedBit) {
  const fs::path file = store(sample_packing());
  const std::string whole = test::read_text(file);
  for (std::size_t byte = 0; byte < whole.size(); ++byte) {
    std::string damaged = whole;
    damaged[byte] = static_cast<char>(damaged[byte] ^ (1 << (byte % 8)));
    expect_refused(file, damaged, "not used");
  }
}

TEST_F(PackingCacheTest, saysWhyAFileIsRefused) {
  const fs::path file = store(sample_packing());
  const std::string whole = test::read_text(file);
  expect_refused(file, "", "too short");
  expect_refused(file, std::string(5000, 'x'), "no such file");
  std::string changed = whole;
  changed[8] = 99;  // format version
  expect_refused(file, changed, "version is 99");
  changed = whole;
  changed[12] = 'f';  // key
  expect_refused(file, changed, "another packing");
  changed = whole;
  std::memset(&changed[44], 0x7F, 8);  // count: must not be allocated
  expect_refused(file, changed, "does not fit");
  changed = whole;
  changed[whole.size() - 20] ^= 1;
  expect_refused(file, changed, "checksum");
}

// Numbers may be invalid although the checksum is right.
TEST_F(PackingCacheTest, refusesNumbersThatAreNoPacking) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double inf = std::numeric_limits<double>::infinity();
  std::vector<Packing> bad(8, sample_packing());
  bad[0].spheres[7].center.y() = nan;
  bad[1].spheres[7].radius = inf;
  bad[2].spheres[7].cover_radius = -0.1;
  bad[3].spheres[7].cover_radius = 0.0;  // below the radius
  bad[4].certificate.max_gap = nan;
  bad[5].certificate.surface_area = -1.0;
  bad[6].certificate.interior_gap = inf;
  bad[7].spheres.clear();
  for (std::size_t i = 0; i < bad.size(); ++i) {
    ASSERT_TRUE(cache_.store(kKey, bad[i], &warning_));
    EXPECT_FALSE(load(cache_)) << i;
    EXPECT_NE(warning_, "") << i;
  }
}

TEST_F(PackingCacheTest, saysWhenTheDiskRefuses) {
  const std::string in_the_way = dir_.write("file", "no folder");
  const PackingCache cache(in_the_way);
  EXPECT_FALSE(cache.store(kKey, sample_packing(), &warning_));
  test::expect_says(warning_, in_the_way);
  EXPECT_EQ(test::read_text(in_the_way), "no folder");

  fs::create_directories(dir_.file("deep/cache/" + kKey + ".istpack/occupied"));
  warning_.clear();
  EXPECT_FALSE(cache_.store(kKey, sample_packing(), &warning_));
  EXPECT_NE(warning_, "");
  EXPECT_FALSE(load(cache_));
  EXPECT_NE(warning_, "");
  // No temporary file remains.
  EXPECT_EQ(std::distance(fs::directory_iterator(dir_.file("deep/cache")), {}), 1);
}

// Every reader sees a complete file or none, while others write.
TEST_F(PackingCacheTest, writersAndReadersDoNotMeetHalfAFile) {
  Packing big = sample_packing();
  while (big.spheres.size() < 3000) big.spheres.push_back(big.spheres[big.spheres.size() % 12]);
  store(big);
  std::vector<std::thread> threads;
  std::vector<std::string> warnings(4);
  for (std::size_t t = 0; t < 4; ++t) {
    threads.emplace_back([&, t] {
      for (int i = 0; i < 30 && warnings[t].empty(); ++i) {
        if (t < 2) {
          cache_.store(kKey, big, &warnings[t]);
        } else if (!cache_.load_unchecked(kKey, kManySpheres, &warnings[t]) &&
                   warnings[t].empty()) {
          warnings[t] = "the file was gone for a moment";
        }
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  for (const std::string& warning : warnings) EXPECT_EQ(warning, "");
}

TEST(PackingKey, differsWhereTheShapeOrTheConfigurationDoes) {
  const PackingConfig config;
  PackingConfig finer = config, fewer = config;
  finer.max_error = 0.004;
  fewer.max_spheres = 100;
  TriangleMesh mesh = test::box({0.1, 0.2, 0.3});
  TriangleMesh moved = mesh;
  moved.vertices[3].x() += 1e-12;
  TriangleMesh flipped = mesh;
  std::swap(flipped.triangles[0][0], flipped.triangles[0][1]);
  const std::set<std::string> keys = {packing_key(Box{{0.1, 0.2, 0.3}}, config),
                                      packing_key(Box{{0.2, 0.1, 0.3}}, config),
                                      packing_key(Box{{0.1, 0.2, 0.3}}, finer),
                                      packing_key(Box{{0.1, 0.2, 0.3}}, fewer),
                                      packing_key(Cylinder{0.1, 0.2}, config),
                                      packing_key(Cylinder{0.2, 0.1}, config),
                                      packing_key(Sphere{0.1}, config),
                                      packing_key(mesh, config),
                                      packing_key(moved, config),
                                      packing_key(flipped, config)};
  EXPECT_EQ(keys.size(), 10U);
  for (const std::string& key : keys) EXPECT_EQ(key.size(), 32U);
}

TEST(PackingKey, isTheSameForTheSameNumbers) {
  const PackingConfig config;
  EXPECT_EQ(packing_key(test::box({1, 2, 3}), config), packing_key(test::box({1, 2, 3}), config));
  TriangleMesh zero{{{0.0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}};
  TriangleMesh minus_zero = zero;
  minus_zero.vertices[0].x() = -0.0;
  EXPECT_EQ(packing_key(zero, config), packing_key(minus_zero, config));
}

TEST(DefaultCacheDirectory, IsInRosHome) {
  const test::Environment home("HOME", "/home/robot");
  {
    const test::Environment ros_home("ROS_HOME", "/var/ros");
    EXPECT_EQ(default_cache_directory(), "/var/ros/ist_proximity");
  }
  for (const char* value : {static_cast<const char*>(nullptr), ""}) {
    const test::Environment ros_home("ROS_HOME", value);
    EXPECT_EQ(default_cache_directory(), "/home/robot/.ros/ist_proximity");
    const test::Environment homeless("HOME", nullptr);
    EXPECT_EQ(default_cache_directory(), "");
  }
}

}  // namespace
}  // namespace ist
