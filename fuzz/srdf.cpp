// SRDF text: pairs of links whose collisions are disabled.
// Covers: src/proximity/self_collision_pairs.cpp

#include <cstddef>
#include <cstdint>
#include <string>

#include "ist_proximity/geometry/error.h"
#include "ist_proximity/proximity/self_query.h"
#include "support/check.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  try {
    const ist::NamePairs pairs = ist::disabled_collisions(text);
    // No shorter element disables a pair.
    const std::size_t shortest = sizeof "<disable_collisions/>" - 1;
    FUZZ_CHECK(pairs.size() * shortest <= size, "%zu pairs in %zu bytes", pairs.size(), size);
  } catch (const ist::ModelError& error) {
    FUZZ_CHECK(error.what()[0] != '\0', "no reason");
  }
  return 0;
}
