#pragma once

#include <string>
#include <vector>

namespace ist {

/// Formats like printf, into a string.
__attribute__((format(printf, 1, 2))) std::string format_text(const char* format, ...);

/// Joins texts: join({"a", "b"}, ", ") is "a, b".
std::string join(const std::vector<std::string>& texts, const std::string& separator);

}  // namespace ist
