#pragma once

#include <cstddef>

/// Sanitizers cost 5 to 20 times the time; tests that count cases do fewer under them.
namespace ist::test {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kSanitized = true;
#else
constexpr bool kSanitized = false;
#endif

/// `count`, or a twentieth under a sanitizer.
constexpr int scaled(int count) { return kSanitized ? (count + 19) / 20 : count; }

/// Of a list of cases every one, or every twentieth under a sanitizer.
constexpr std::size_t kStride = kSanitized ? 20 : 1;

/// [m] Packing takes longest under a sanitizer: links are packed more coarsely there.
constexpr double packed_to(double max_error) { return kSanitized ? 4.0 * max_error : max_error; }

}  // namespace ist::test
