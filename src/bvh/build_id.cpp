#include "internal/bvh/build_id.h"

#include <atomic>

namespace ist {

std::uint64_t next_build_id() {
  static std::atomic<std::uint64_t> builds{0};
  return ++builds;
}

}  // namespace ist
