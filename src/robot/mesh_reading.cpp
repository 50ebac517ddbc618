#include "mesh_reading.h"

#include <algorithm>
#include <mutex>
#include <utility>

#include "internal/geometry/cancelled.h"
#include "internal/geometry/limits.h"
#include "internal/geometry/mesh_io.h"
#include "internal/robot/threads.h"
#include "ist_proximity/geometry/error.h"

namespace ist {
namespace {

// Each thread takes the memory of a mesh file and of its import: gigabytes for the largest.
constexpr std::size_t kMostThreads = 4;

// The bits of the numbers: NaN, which load_mesh() refuses, has no order.
std::string key_of(const std::string& path, const Eigen::Vector3d& scale) {
  std::string key = path;
  return key.append(reinterpret_cast<const char*>(scale.data()), 3 * sizeof(double));
}

}  // namespace

std::size_t MeshReading::add(const std::string& link, const std::string& uri,
                             const std::string& path, const Eigen::Vector3d& scale) {
  const auto [found, is_new] = index_.insert({key_of(path, scale), files_.size()});
  if (is_new) files_.push_back({link, printable(uri), path, scale, 0, {}, {}});
  ++files_[found->second].uses;
  return found->second;
}

void MeshReading::read(const ReadingProgress& progress) {
  std::mutex mutex;
  bool is_stopped = false;
  const auto threads = static_cast<int>(std::min(thread_count(0), kMostThreads));
  for_each_in_parallel(files_.size(), threads, [&](std::size_t i) {
    File& file = files_[i];
    const auto cancelled = [&] {
      const std::lock_guard<std::mutex> lock(mutex);
      is_stopped = is_stopped || (progress && !progress(file.link, file.uri));
      return is_stopped;
    };
    throw_if(cancelled);
    try {
      file.mesh = load_mesh(file.path, file.scale, cancelled);
    } catch (const ModelError& error) {
      file.error = error.what();
    }
  });
}

TriangleMesh MeshReading::take(std::size_t index) {
  File& file = files_[index];
  if (!file.error.empty()) throw ModelError(file.error);
  return --file.uses > 0 ? file.mesh : std::move(file.mesh);
}

}  // namespace ist
