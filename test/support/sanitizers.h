#pragma once

#include <cstddef>

/// Sanitizers make tests 5 to 20 times slower, so tests run fewer cases under them.
namespace ist::test {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kSanitized = true;
#else
constexpr bool kSanitized = false;
#endif

/// `count`, or a twentieth under a sanitizer.
constexpr int scaled(int count) { return kSanitized ? (count + 19) / 20 : count; }

/// Step through a list of cases: every one, or every twentieth under a sanitizer.
constexpr std::size_t kStride = kSanitized ? 20 : 1;

/// The max_error [m] of a packing: packing takes most of the time under a sanitizer, so links are
/// packed more coarsely there.
constexpr double packed_to(double max_error) { return kSanitized ? 4.0 * max_error : max_error; }

}  // namespace ist::test
