#include "internal/cloud/unmeasured.h"

#include <cstdint>
#include <utility>

namespace ist {

std::string unmeasured(const IngestCounts& counts) {
  const std::pair<std::uint32_t, const char*> parts[] = {
      {counts.not_a_number, "NaN"},
      {counts.noise, "noise"},
      {counts.infinite_is_free ? 0U : counts.infinite, "infinite"},
      {counts.too_near, "nearer than min_range"},
      {counts.not_believed, "farther than the sensor can measure"},
      {counts.at_one_place, "at one place"}};
  std::string text;
  for (const auto& [count, what] : parts) {
    if (count > 0) text += (text.empty() ? "" : ", ") + std::to_string(count) + " are " + what;
  }
  return text;
}

}  // namespace ist
