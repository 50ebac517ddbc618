#pragma once

#include <cstddef>
#include <exception>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "internal/geometry/mesh_surface.h"
#include "internal/packing/packing_cache.h"
#include "ist_proximity/geometry/shapes.h"
#include "ist_proximity/packing/packing.h"

namespace ist {

/// One distinct shape to pack, and the result.
struct PackingJob {
  const Shape* shape = nullptr;
  std::optional<MeshSurface> surface;  ///< of a mesh
  PackingConfig config;                ///< of the final packing
  PackingConfig now;  ///< what is packed now where the cache does not have the final packing
  std::string key;    ///< of the final packing
  bool look_in_cache = true;
  std::size_t link = 0;  ///< the first link that needs it
  double work = 1.0;     ///< relative to other jobs

  Packing packing;
  bool is_final = false;  ///< `packing` is the final one; only such are kept in the cache
  bool from_cache = false;
  double time = 0.0;  ///< [s]
  std::string error;  ///< why there is no packing
  std::string load_warning, store_warning;
};

/// Packs shapes on several threads, the most work first, through the cache.
class PackingJobs {
 public:
  /// Called from any thread, one call at a time: the job that has been at work longest, and how
  /// much of all is done (0 to 1). Returning false stops everything soon.
  using Report = std::function<bool(const PackingJob& job, double fraction)>;

  PackingJobs(std::vector<PackingJob>* jobs, const PackingCache& cache, Report report);

  /// @param threads  0: as many as there are cores
  /// @returns false when `report` stopped it. What `report` throws comes out here.
  bool run(int threads);

 private:
  void work();
  void pack(std::size_t index);
  bool report(std::size_t index, double fraction);
  bool take(std::size_t* index);
  void finish(std::size_t index);

  std::vector<PackingJob>& jobs_;
  const PackingCache& cache_;
  const Report report_;
  std::vector<std::size_t> order_;

  std::mutex mutex_;  // guards all below
  std::size_t next_ = 0;
  std::vector<double> done_;          // by job, 0 to 1
  std::vector<std::size_t> at_work_;  // jobs in the order in which they were begun
  bool stopped_ = false;
  std::exception_ptr failure_;
};

}  // namespace ist
