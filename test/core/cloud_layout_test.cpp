#include "ist_proximity/cloud/ingest.h"

#include <gtest/gtest.h>

#include <limits>
#include "support/errors.h"

namespace ist {
namespace {

constexpr std::uint8_t kInt16 = 3, kUint32 = 6, kFloat32 = 7, kFloat64 = 8;
constexpr std::uint32_t kMax = std::numeric_limits<std::uint32_t>::max();

class CloudLayoutTest : public ::testing::Test {
 protected:
  CloudLayoutTest() : bytes_(4096) {
    layout_.fields = {{"x", 0, kFloat32, 1},
                      {"y", 4, kFloat32, 1},
                      {"z", 8, kFloat32, 1},
                      {"rgb", 12, kFloat32, 1}};
    layout_.width = 8;
    layout_.height = 4;
    layout_.point_step = 16;
    layout_.row_step = 128;
    layout_.data = bytes_.data();
    layout_.data_size = 512;
  }

  // One sentence that holds all the words.
  void expect_fault(const std::vector<std::string>& words) {
    RawCloud cloud;
    const std::string fault = check_layout(layout_, &cloud);
    ASSERT_FALSE(fault.empty());
    EXPECT_EQ(fault.back(), '.');
    EXPECT_EQ(fault.find('\n'), std::string::npos);
    for (const std::string& word : words) {
      EXPECT_NE(fault.find(word), std::string::npos) << "'" << word << "' not in: " << fault;
    }
    EXPECT_EQ(cloud.data, nullptr) << "a faulty layout must not be usable";
  }

  // Changes of the layout, one by one, and the words that name what is wrong then.
  struct Fault {
    void (*change)(CloudLayout*);
    std::vector<std::string> words;
  };
  void expect_faults(const std::vector<Fault>& faults) {
    const CloudLayout whole = layout_;
    for (std::size_t i = 0; i < faults.size(); ++i) {
      SCOPED_TRACE(i);
      layout_ = whole;
      faults[i].change(&layout_);
      expect_fault(faults[i].words);
    }
  }

  RawCloud expect_valid() {
    RawCloud cloud;
    EXPECT_EQ(check_layout(layout_, &cloud), "");
    return cloud;
  }

  std::vector<std::uint8_t> bytes_;
  CloudLayout layout_;
};

TEST_F(CloudLayoutTest, fieldsMayComeInAnyOrderAndPlace) {
  layout_.fields = {{"intensity", 0, kUint32, 1},
                    {"z", 21, kFloat64, 1},
                    {"x", 5, kFloat64, 1},
                    {"y", 13, kFloat64, 1}};
  layout_.point_step = 31;
  layout_.row_step = 300;
  layout_.data_size = 1200;
  const RawCloud cloud = expect_valid();
  EXPECT_TRUE(cloud.is_double);
  EXPECT_EQ(cloud.x, 5U);
  EXPECT_EQ(cloud.y, 13U);
  EXPECT_EQ(cloud.z, 21U);
}

// What a message says that contradicts itself, and the words that name it.
TEST_F(CloudLayoutTest, faultsAreNamed) {
  using L = CloudLayout;
  expect_faults(
      {{[](L* l) { l->fields.erase(l->fields.begin()); }, {"'x'", "missing"}},
       {[](L* l) { l->fields.erase(l->fields.begin() + 1); }, {"'y'", "missing"}},
       {[](L* l) { l->fields.erase(l->fields.begin() + 2); }, {"'z'", "missing"}},
       {[](L* l) { l->fields.clear(); }, {"'x'", "missing"}},
       {[](L* l) { l->fields[1].datatype = kInt16; }, {"'y'", "int16 (3)", "float32"}},
       {[](L* l) { l->fields[1].datatype = 0; }, {"'y'", "unknown (0)"}},
       {[](L* l) { l->fields[1].datatype = 200; }, {"'y'", "unknown (200)"}},
       {[](L* l) { l->fields[2].datatype = kFloat64; },
        {"'x'", "float32 (7)", "'z'", "float64 (8)"}},
       {[](L* l) { l->fields[0].count = 3; }, {"'x'", "count 3"}},
       {[](L* l) { l->fields[2].offset = 13; }, {"'z'", "offset 13", "17", "point_step of 16"}},
       // Offset and size do not fit 32 bits.
       {[](L* l) { l->fields[2].offset = kMax - 1; }, {"'z'", std::to_string(kMax - 1)}},
       {[](L* l) { l->fields[1].offset = 2; }, {"'x'", "'y'", "offset 2", "overlap"}},
       {[](L* l) { l->fields[1].offset = 0; }, {"overlap"}},
       {[](L* l) { l->fields[3].name = "y"; }, {"'y'", "2 times"}},
       {[](L* l) { l->point_step = 0; }, {"point_step", "0"}},
       {[](L* l) { l->row_step = 127; }, {"row_step", "127", "width 8", "point_step 16", "128"}},
       {[](L* l) { l->row_step = 127, l->height = 1; }, {"row_step", "127"}},
       {[](L* l) { l->row_step = 0; }, {"row_step", "0", "128"}},
       {[](L* l) { l->data_size = 511; }, {"data", "511", "height 4", "row_step 128", "512"}},
       {[](L* l) { l->data_size = 0, l->data = nullptr; }, {"data", "0 bytes"}},
       {[](L* l) { l->data = nullptr; }, {"null"}},
       // 2^32 - 1 rows of 2^32 - 1 bytes: in 32 bits the product is 1, and would pass.
       {[](L* l) { l->width = kMax; }, {"row_step", std::to_string(16ULL * kMax)}},
       {[](L* l) { l->width = 1, l->height = l->row_step = kMax; },
        {"data", std::to_string(std::uint64_t{kMax} * kMax)}},
       // A width that times 16 is 2^32, which is 0 in 32 bits.
       {[](L* l) { l->width = 1U << 28, l->height = 1, l->row_step = 0; }, {"data", "4294967296"}},
       {[](L* l) {
          l->width = l->height = 1U << 16;
          l->row_step = 1U << 20;
          l->data_size = std::numeric_limits<std::size_t>::max();
        },
        {"65536", "32 bits"}}});
}

// Drivers leave out numbers that follow from others, and add fields and bytes of their own.
TEST_F(CloudLayoutTest, whatIsLeftOutOrAddedIsTolerated) {
  const CloudLayout whole = layout_;
  for (RawField& field : layout_.fields) field.count = 0;
  EXPECT_EQ(expect_valid().size(), 32U);
  layout_ = whole;
  layout_.row_step = 0;
  layout_.height = 1;
  EXPECT_EQ(expect_valid().row_step, 128U);
  layout_ = whole;
  layout_.data_size = 4096;
  layout_.fields[3] = {"rgb", 1000, 77, 0};
  layout_.fields.push_back({"rgb", 1000, 77, 0});
  layout_.fields.push_back({"", 0, 0, 0});
  expect_valid();
}

// An empty cloud with its fields is a measurement of nothing. Drivers fill in the steps or leave
// them out.
TEST_F(CloudLayoutTest, emptyCloudWithItsFieldsIsValid) {
  layout_.data_size = 0;
  for (const std::uint8_t* data : {static_cast<const std::uint8_t*>(nullptr), layout_.data}) {
    layout_.data = data;
    for (const std::uint32_t point_step : {0U, 16U}) {
      layout_.point_step = point_step;
      layout_.width = 0;
      layout_.row_step = 0;
      for (const std::uint32_t height : {0U, 1U, 4U}) {
        layout_.height = height;
        EXPECT_EQ(expect_valid().size(), 0U);
        EXPECT_EQ(expect_valid().width + expect_valid().height, 0U);
      }
      layout_.height = 0;
      layout_.width = 100;
      for (const std::uint32_t row_step : {0U, 1600U}) {
        layout_.row_step = row_step;
        EXPECT_EQ(expect_valid().size(), 0U);
      }
    }
  }
}

// A cloud that says to be empty and holds bytes is not one of nothing: an obstacle may be in them.
// One of colours alone, or of no field at all, has not measured where anything is.
TEST_F(CloudLayoutTest, whatIsNotEmptyOrHasNoCoordinatesIsFaulty) {
  using L = CloudLayout;
  expect_faults(
      {{[](L* l) { l->width = l->row_step = 0; }, {"width 0", "height 4", "no point", "512 bytes"}},
       {[](L* l) { l->width = l->height = l->row_step = 0; },
        {"width 0", "height 0", "no point", "512 bytes"}},
       {[](L* l) { l->height = 0; }, {"width 8", "height 0", "no point", "512 bytes"}},
       {[](L* l) { l->height = 0, l->data_size = 1; }, {"1 bytes"}},
       // Rows of 128 bytes are announced, and none is there.
       {[](L* l) { l->width = 0, l->data_size = 0; },
        {"data holds 0 bytes", "height 4", "row_step 128"}}});
  layout_.width = layout_.height = layout_.row_step = 0;
  layout_.data_size = 0;
  layout_.data = nullptr;
  expect_faults({{[](L* l) { l->fields.clear(); }, {"'x'", "missing"}},
                 {[](L* l) {
                    l->fields = {{"rgb", 0, kFloat32, 1}};
                  },
                  {"'x'", "missing"}},
                 {[](L* l) { l->fields.resize(2); }, {"'z'", "missing"}},
                 {[](L* l) { l->fields[0].datatype = kInt16; }, {"'x'", "int16"}},
                 {[](L* l) { l->fields[1].offset = 0; }, {"overlap"}},
                 {[](L* l) { l->point_step = 8; }, {"'z'", "point_step of 8"}}});
}

TEST_F(CloudLayoutTest, morePointsThanAllowed) {
  RawCloud cloud;
  EXPECT_EQ(check_layout(layout_, &cloud, 32), "");
  cloud = RawCloud();
  const std::string fault = check_layout(layout_, &cloud, 31);
  test::expect_says(fault, "32 points, allowed are at most 31 (max_points)");
  EXPECT_EQ(cloud.data, nullptr);
}

}  // namespace
}  // namespace ist
