// SRDF text: pairs of links whose collisions are disabled.
// Covers: src/proximity/srdf.cpp

#include <cstddef>
#include <cstdint>
#include <string>

#include "ist_proximity/geometry/error.h"
#include "ist_proximity/proximity/collision_rules.h"
#include "support/check.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  try {
    const auto pairs = ist::read_srdf(text, nullptr).disabled;
    // No shorter element disables a pair.
    const std::size_t shortest = sizeof "<disable_collisions/>" - 1;
    FUZZ_CHECK(pairs.size() * shortest <= size, "%zu pairs in %zu bytes", pairs.size(), size);
  } catch (const ist::ModelError& error) {
    FUZZ_CHECK(error.what()[0] != '\0', "no reason");
  }
  return 0;
}
