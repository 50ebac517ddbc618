#pragma once

#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>

namespace ist::test {

/// The folder of third-party test data (robots, clouds, poses): IST_PROXIMITY_DATA, or
/// ../shared/data from the repository's root. Nothing if there is no such folder; then
///   if (!data_dir()) GTEST_SKIP() << kNoData;
inline std::optional<std::filesystem::path> data_dir() {
  const char* variable = std::getenv("IST_PROXIMITY_DATA");
  const std::filesystem::path folder =
      variable != nullptr ? std::filesystem::path(variable)
                          : std::filesystem::path(IST_PROXIMITY_SOURCE_DIR) / "../shared/data";
  std::error_code ignored;
  if (!std::filesystem::is_directory(folder / "robots", ignored)) return std::nullopt;
  return folder;
}

inline const std::string kNoData =
    "test data not found: set IST_PROXIMITY_DATA to the folder that holds robots/, clouds/, poses/";

/// The folder of the Franka Panda's ROS package, franka_description.
inline std::string franka_package(const std::filesystem::path& data) {
  return (data / "robots" / "franka_description").string();
}

}  // namespace ist::test
