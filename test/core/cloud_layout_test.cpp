#include "ist_proximity/cloud/ingest.h"

#include <gtest/gtest.h>

#include <limits>

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

  RawCloud expect_valid() {
    RawCloud cloud;
    EXPECT_EQ(check_layout(layout_, &cloud), "");
    return cloud;
  }

  std::vector<std::uint8_t> bytes_;
  CloudLayout layout_;
};

TEST_F(CloudLayoutTest, readsAValidLayout) {
  const RawCloud cloud = expect_valid();
  EXPECT_EQ(cloud.data, bytes_.data());
  EXPECT_EQ(cloud.width, 8U);
  EXPECT_EQ(cloud.height, 4U);
  EXPECT_EQ(cloud.size(), 32U);
  EXPECT_EQ(cloud.point_step, 16U);
  EXPECT_EQ(cloud.row_step, 128U);
  EXPECT_EQ(cloud.x, 0U);
  EXPECT_EQ(cloud.y, 4U);
  EXPECT_EQ(cloud.z, 8U);
  EXPECT_FALSE(cloud.is_double);
}

TEST_F(CloudLayoutTest, byteOrderIsComparedWithTheMachines) {
  const bool little = expect_valid().swap_bytes;
  layout_.is_bigendian = true;
  EXPECT_NE(little, expect_valid().swap_bytes);
}

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

TEST_F(CloudLayoutTest, missingCoordinate) {
  for (const std::size_t i : {0U, 1U, 2U}) {
    CloudLayout whole = layout_;
    layout_.fields.erase(layout_.fields.begin() + static_cast<std::ptrdiff_t>(i));
    expect_fault({std::string("'") + "xyz"[i] + "'", "missing"});
    layout_ = whole;
  }
}

TEST_F(CloudLayoutTest, noFieldsAtAll) {
  layout_.fields.clear();
  expect_fault({"'x'", "missing"});
}

TEST_F(CloudLayoutTest, wrongDatatypeIsNamed) {
  layout_.fields[1].datatype = kInt16;
  expect_fault({"'y'", "int16 (3)", "float32"});
  layout_.fields[1].datatype = 0;
  expect_fault({"'y'", "unknown (0)"});
  layout_.fields[1].datatype = 200;
  expect_fault({"'y'", "unknown (200)"});
}

TEST_F(CloudLayoutTest, mixedPrecision) {
  layout_.fields[2].datatype = kFloat64;
  expect_fault({"'x'", "float32 (7)", "'z'", "float64 (8)"});
}

TEST_F(CloudLayoutTest, countOtherThanOne) {
  layout_.fields[0].count = 3;
  expect_fault({"'x'", "count 3"});
}

TEST_F(CloudLayoutTest, countLeftOutIsOne) {
  for (RawField& field : layout_.fields) field.count = 0;
  EXPECT_EQ(expect_valid().size(), 32U);
}

TEST_F(CloudLayoutTest, offsetOutsideThePoint) {
  layout_.fields[2].offset = 13;
  expect_fault({"'z'", "offset 13", "17", "point_step of 16"});
  layout_.fields[2].offset = kMax - 1;  // offset + size does not fit 32 bits
  expect_fault({"'z'", std::to_string(kMax - 1)});
}

TEST_F(CloudLayoutTest, overlappingCoordinates) {
  layout_.fields[1].offset = 2;
  expect_fault({"'x'", "'y'", "offset 2", "overlap"});
  layout_.fields[1].offset = 0;
  expect_fault({"overlap"});
}

TEST_F(CloudLayoutTest, duplicateNames) {
  layout_.fields[3].name = "y";
  expect_fault({"'y'", "2 times"});
}

TEST_F(CloudLayoutTest, otherFieldsAreIgnored) {
  layout_.fields[3] = {"rgb", 1000, 77, 0};
  layout_.fields.push_back({"rgb", 1000, 77, 0});
  layout_.fields.push_back({"", 0, 0, 0});
  expect_valid();
}

TEST_F(CloudLayoutTest, pointStepOfZero) {
  layout_.point_step = 0;
  expect_fault({"point_step", "0"});
}

TEST_F(CloudLayoutTest, rowStepTooSmall) {
  layout_.row_step = 127;
  expect_fault({"row_step", "127", "width 8", "point_step 16", "128"});
  layout_.height = 1;
  expect_fault({"row_step", "127"});
}

TEST_F(CloudLayoutTest, rowStepLeftOutIsToleratedInOneRowOnly) {
  layout_.row_step = 0;
  expect_fault({"row_step", "0", "128"});
  layout_.height = 1;
  EXPECT_EQ(expect_valid().row_step, 128U);
}

TEST_F(CloudLayoutTest, dataTooShort) {
  layout_.data_size = 511;
  expect_fault({"data", "511", "height 4", "row_step 128", "512"});
  layout_.data_size = 0;
  layout_.data = nullptr;
  expect_fault({"data", "0 bytes"});
}

TEST_F(CloudLayoutTest, moreDataThanNeeded) {
  layout_.data_size = 4096;
  expect_valid();
}

TEST_F(CloudLayoutTest, nullData) {
  layout_.data = nullptr;
  expect_fault({"null"});
}

// 2^32 - 1 rows of 2^32 - 1 bytes: in 32 bits the product is 1, and would pass.
TEST_F(CloudLayoutTest, sizesThatOverflow) {
  layout_.width = kMax;
  expect_fault({"row_step", std::to_string(16ULL * kMax)});
  layout_.width = 1;
  layout_.height = kMax;
  layout_.row_step = kMax;
  expect_fault({"data", std::to_string(std::uint64_t{kMax} * kMax)});
  layout_.width = 1U << 28;  // times 16 is 2^32, which is 0 in 32 bits
  layout_.height = 1;
  layout_.row_step = 0;
  expect_fault({"data", "4294967296"});
}

TEST_F(CloudLayoutTest, morePointsThanIdsCanNumber) {
  layout_.width = 1U << 16;
  layout_.height = 1U << 16;
  layout_.row_step = 1U << 20;
  layout_.data_size = std::numeric_limits<std::size_t>::max();
  expect_fault({"65536", "32 bits"});
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
TEST_F(CloudLayoutTest, emptyCloudWithDataContradictsItself) {
  const CloudLayout whole = layout_;
  layout_.width = 0;
  layout_.row_step = 0;
  expect_fault({"width 0", "height 4", "no point", "512 bytes"});
  layout_.height = 0;
  expect_fault({"width 0", "height 0", "no point", "512 bytes"});
  layout_ = whole;
  layout_.height = 0;
  expect_fault({"width 8", "height 0", "no point", "512 bytes"});
  layout_.data_size = 1;
  expect_fault({"1 bytes"});
  layout_.data_size = 0;  // rows of 128 bytes are announced, and none is there
  layout_.width = 0;
  layout_.height = 4;
  expect_fault({"data holds 0 bytes", "height 4", "row_step 128"});
}

// A cloud of colours alone, or of no field at all, has not measured where anything is.
TEST_F(CloudLayoutTest, emptyCloudWithoutCoordinatesIsFaulty) {
  layout_.width = layout_.height = layout_.row_step = 0;
  layout_.data_size = 0;
  layout_.data = nullptr;
  const CloudLayout empty = layout_;
  layout_.fields.clear();
  expect_fault({"'x'", "missing"});
  layout_.fields = {{"rgb", 0, kFloat32, 1}};
  expect_fault({"'x'", "missing"});
  layout_ = empty;
  layout_.fields.erase(layout_.fields.begin() + 2);
  expect_fault({"'z'", "missing"});
  layout_ = empty;
  layout_.fields[0].datatype = kInt16;
  expect_fault({"'x'", "int16"});
  layout_ = empty;
  layout_.fields[1].offset = 0;
  expect_fault({"overlap"});
  layout_ = empty;
  layout_.point_step = 8;
  expect_fault({"'z'", "point_step of 8"});
}

TEST_F(CloudLayoutTest, morePointsThanAllowed) {
  RawCloud cloud;
  EXPECT_EQ(check_layout(layout_, &cloud, 32), "");
  cloud = RawCloud();
  const std::string fault = check_layout(layout_, &cloud, 31);
  EXPECT_NE(fault.find("32 points, allowed are at most 31 (max_points)"), std::string::npos)
      << fault;
  EXPECT_EQ(cloud.data, nullptr);
}

}  // namespace
}  // namespace ist
