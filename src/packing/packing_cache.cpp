#include "internal/packing/packing_cache.h"

#include <fcntl.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <filesystem>

#include "internal/geometry/regular_file.h"
#include "internal/packing/packing_check.h"
#include "packing_file.h"

namespace ist {
namespace {

namespace fs = std::filesystem;

// Writes and syncs a new file, so that after the rename it is complete even if the power fails.
// Returns why it could not be done, or an empty string.
std::string write_synced(const std::string& path, const std::string& bytes) {
  const int file = open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  if (file < 0) return std::strerror(errno);
  std::string problem;
  std::size_t written = 0;
  while (written < bytes.size() && problem.empty()) {
    const ssize_t n = write(file, bytes.data() + written, bytes.size() - written);
    if (n >= 0) {
      written += static_cast<std::size_t>(n);
    } else if (errno != EINTR) {
      problem = std::strerror(errno);
    }
  }
  if (problem.empty() && fsync(file) != 0) problem = std::strerror(errno);
  if (close(file) != 0 && problem.empty()) problem = std::strerror(errno);
  return problem;
}

constexpr const char* kTemporary = ".tmp";
// Writing a packing takes seconds at most, so that a temporary file that has not changed for so
// long has no writer any more: it was killed, here or on another machine that shares the folder.
constexpr std::chrono::hours kStale(1);

// The name is unique among processes, threads and files that crashed processes left behind.
std::string temporary_name(const std::string& path) {
  static std::atomic<unsigned> counter{0};
  const auto now = std::chrono::system_clock::now().time_since_epoch().count();
  return path + "." + std::to_string(getpid()) + "." + std::to_string(counter++) + "." +
         std::to_string(now) + kTemporary;
}

// Whether a file has a name as temporary_name() makes them.
bool is_temporary(const fs::path& path) {
  return path.extension() == kTemporary &&
         (path.filename().string().find(".istpack.") != std::string::npos ||
          path.filename().string().find(".istfield.") != std::string::npos ||
          path.filename().string().find(".istpairs.") != std::string::npos);
}

// Removes the temporary files that writers which were killed have left in a folder. Others, and
// files that cannot be removed, stay.
void remove_stale(const std::string& folder) {
  std::error_code error;
  const auto now = fs::file_time_type::clock::now();
  fs::directory_iterator file(folder, error);
  for (; !error && file != fs::directory_iterator(); file.increment(error)) {
    std::error_code ignored;
    if (!is_temporary(file->path()) || !file->is_regular_file(ignored)) continue;
    const auto written = fs::last_write_time(file->path(), ignored);
    if (!ignored && now - written > kStale) fs::remove(file->path(), ignored);
  }
}

}  // namespace

std::string default_cache_directory() {
  const char* ros_home = std::getenv("ROS_HOME");
  if (ros_home != nullptr && *ros_home != '\0') return std::string(ros_home) + "/ist_proximity";
  const char* home = std::getenv("HOME");
  if (home == nullptr || *home == '\0') return {};
  return std::string(home) + "/.ros/ist_proximity";
}

std::string PackingCache::path(const std::string& key) const {
  return (fs::path(directory_) / (key + ".istpack")).string();
}

namespace {

std::string not_used(const std::string& file_name, const std::string& problem) {
  return "packing cache file '" + file_name + "' is not used: " + problem;
}

}  // namespace

std::optional<Packing> PackingCache::load_unchecked(const std::string& key, std::size_t max_spheres,
                                                    std::string* warning) const {
  if (directory_.empty()) return std::nullopt;
  const std::string file_name = path(key);
  std::error_code error;
  if (!fs::exists(file_name, error) && !error) return std::nullopt;
  std::string bytes;
  std::string problem = read_regular_file(file_name, packing_file_size(max_spheres), &bytes);
  if (!problem.empty()) problem = "it " + problem;
  Packing packing;
  if (problem.empty()) problem = parse_packing(bytes, key, &packing);
  if (problem.empty()) return packing;
  *warning = not_used(file_name, problem);
  return std::nullopt;
}

std::optional<Packing> PackingCache::load(const std::string& key, const Shape& shape,
                                          const PackingConfig& config,
                                          const PackingProgress& progress,
                                          std::string* warning) const {
  std::optional<Packing> packing =
      load_unchecked(key, static_cast<std::size_t>(config.max_spheres), warning);
  if (!packing) return std::nullopt;
  const std::string fault = packing_fault(shape, config, *packing, progress);
  if (fault.empty()) return packing;
  *warning = not_used(path(key), fault);
  return std::nullopt;
}

std::string write_cache_file(const std::string& directory, const std::string& file_name,
                             const std::string& bytes) {
  const std::string temporary = temporary_name(file_name);
  std::error_code error;
  fs::create_directories(directory, error);
  remove_stale(directory);
  std::string problem = error ? error.message() : write_synced(temporary, bytes);
  if (problem.empty()) {
    fs::rename(temporary, file_name, error);
    if (!error) return "";
    problem = error.message();
  }
  unlink(temporary.c_str());
  return problem;
}

bool PackingCache::store(const std::string& key, const Packing& packing,
                         std::string* warning) const {
  if (directory_.empty()) return true;
  const std::string file_name = path(key);
  const std::string problem =
      write_cache_file(directory_, file_name, serialize_packing(key, packing));
  if (problem.empty()) return true;
  *warning = "packing cache file '" + file_name + "' cannot be written (" + problem +
             "); the packing will be computed again next time";
  return false;
}

}  // namespace ist
