#pragma once

#include <cstdint>

namespace ist {

/// Another number at each call, never 0: identifies one build of an index, of whatever kind. Thread
/// safe.
std::uint64_t next_build_id();

}  // namespace ist
