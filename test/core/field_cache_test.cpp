// The cache of distance fields: what it gives back is what was measured, and what is damaged or of
// another geometry is told and not used.

#include "robot/field_cache.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <vector>

#include "internal/geometry/solid_queries.h"
#include "ist_proximity/robot/robot_model.h"
#include "support/accuracy.h"
#include "support/demo_arm.h"
#include "support/meshes.h"
#include "support/random_links.h"
#include "support/temp_dir.h"

namespace ist {
namespace {

namespace fs = std::filesystem;

bool is_same(const DistanceField& a, const DistanceField& b) {
  return a.values() == b.values() && a.outside() == b.outside() &&
         a.surface_xy() == b.surface_xy() && a.surface_z_ball() == b.surface_z_ball() &&
         a.surface_step() == b.surface_step() && a.is_closed() == b.is_closed() &&
         a.bounds().isApprox(b.bounds(), 0.0F) && a.levels().size() == b.levels().size();
}

std::vector<fs::path> fields_in(const fs::path& folder) {
  std::vector<fs::path> found;
  for (const auto& file : fs::directory_iterator(folder)) {
    if (file.path().extension() == ".istfield") found.push_back(file.path());
  }
  return found;
}

std::vector<LinkGeometry> geometries() {
  return {test::one(Sphere{0.1}),
          test::one(Box{{0.1, 0.2, 0.3}}),
          test::one(test::l_shape(0.2, 0.04)),
          test::one(test::torus(0.1, 0.03, 24, 12)),
          {{Sphere{0.05}, Eigen::Isometry3d::Identity(), "a"},
           {Box{{0.1, 0.1, 0.1}}, Eigen::Isometry3d(Eigen::Translation3d(0.1, 0.0, 0.0)), "b"}}};
}

class FieldCacheTest : public testing::Test {
 protected:
  test::TempDir dir_;
  const FieldCache cache_{dir_.path().string()};
  std::string warning_;
};

TEST_F(FieldCacheTest, givesBackWhatWasMeasured) {
  for (const LinkGeometry& geometry : geometries()) {
    const Solid solid(geometry);
    const DistanceField field(solid);
    const std::string key = field_key(geometry);
    EXPECT_EQ(cache_.load(key, solid, &warning_), nullptr);
    cache_.store(key, field, &warning_);
    const auto loaded = cache_.load(key, solid, &warning_);
    ASSERT_NE(loaded, nullptr) << warning_;
    EXPECT_TRUE(is_same(*loaded, field));
    EXPECT_EQ(loaded->detail(), DistanceField::Detail::kFine);
  }
  EXPECT_EQ(warning_, "");
  EXPECT_EQ(fields_in(dir_.path()).size(), geometries().size());
}

TEST_F(FieldCacheTest, keysTellGeometriesApart) {
  LinkGeometry moved = test::one(Sphere{0.1});
  moved[0].X_LE.translation().x() = 1e-9;
  EXPECT_NE(field_key(moved), field_key(test::one(Sphere{0.1})));
  EXPECT_NE(field_key(test::one(Sphere{0.1})), field_key(test::one(Sphere{0.1 + 1e-12})));
  EXPECT_EQ(field_key(test::one(Sphere{0.1})), field_key(test::one(Sphere{0.1})));
}

// Wherever a file is cut off or a bit of it is wrong, it is told and not used.
TEST_F(FieldCacheTest, damagedFilesAreNotUsed) {
  const LinkGeometry geometry = test::one(Box{{0.1, 0.05, 0.08}});
  const Solid solid(geometry);
  const std::string key = field_key(geometry);
  cache_.store(key, DistanceField(solid), &warning_);
  const fs::path file = fields_in(dir_.path()).at(0);
  const std::string whole = test::read_text(file.string());
  for (std::size_t i = 0; i < 100; ++i) {
    std::string bytes = whole;
    const std::size_t at = i * (whole.size() - 1) / 99;
    bytes[at] = static_cast<char>(bytes[at] ^ 4);
    for (const std::string& damaged : {bytes, whole.substr(0, at)}) {
      dir_.write(file.filename().string(), damaged);
      warning_.clear();
      EXPECT_EQ(cache_.load(key, solid, &warning_), nullptr) << at;
      EXPECT_NE(warning_.find(file.string()), std::string::npos) << warning_;
    }
  }
}

// A file whose checksum is right may still be of another geometry.
TEST_F(FieldCacheTest, fieldsOfOtherGeometriesAreNotUsed) {
  const auto all = geometries();
  for (std::size_t i = 0; i < all.size(); ++i) {
    const Solid solid(all[i]);
    for (std::size_t k = 0; k < all.size(); ++k) {
      EXPECT_EQ(field_fault(DistanceField(Solid(all[k])), solid).empty(), i == k) << i << " " << k;
    }
    LinkGeometry larger = all[i];
    for (GeometryElement& element : larger) element.X_LE.translation().z() += 0.002;
    EXPECT_NE(field_fault(DistanceField(Solid(larger)), solid), "") << "moved by 2 mm";
  }
}

// A robot that is made again has the same fields, and equal links share one.
TEST_F(FieldCacheTest, robotsReadTheirFieldsAgain) {
  RobotModelConfig config;
  config.cache_directory = dir_.path().string();
  config.distance_fields = true;
  std::vector<std::string> warnings;
  RobotModelCallbacks callbacks;
  callbacks.warning = [&](const std::string& warning) { warnings.push_back(warning); };
  const auto make = [&] { return build_robot_model(test::demo_robot(), config, callbacks); };
  const auto first = make();
  const std::vector<fs::path> files = fields_in(dir_.path());
  ASSERT_FALSE(files.empty());
  EXPECT_LE(files.size(), first->links.size());
  const auto time = fs::last_write_time(files[0]);
  const auto expect_same = [&](const RobotModel& again) {
    for (std::size_t i = 0; i < first->links.size(); ++i) {
      EXPECT_TRUE(is_same(*again.links[i].field, *first->links[i].field)) << i;
    }
  };
  expect_same(*make());
  EXPECT_EQ(fs::last_write_time(files[0]), time) << "it was read";
  EXPECT_TRUE(warnings.empty()) << warnings[0];
  dir_.write(files[0].filename().string(), "no field");
  expect_same(*make());
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_NE(warnings[0].find(files[0].filename().string()), std::string::npos) << warnings[0];
  EXPECT_GT(fs::file_size(files[0]), 1000U) << "it was measured and stored again";
}

TEST_F(FieldCacheTest, aFolderThatCannotBeWrittenIsTold) {
  const std::string file = dir_.write("file", "");
  const FieldCache cache(file);
  cache.store("0123456789abcdef0123456789abcdef", DistanceField(Solid(test::one(Sphere{0.1}))),
              &warning_);
  EXPECT_NE(warning_.find("cannot be written"), std::string::npos) << warning_;
}

}  // namespace
}  // namespace ist
