#pragma once

#include <set>
#include <string>
#include <vector>

namespace ist {

/// Formats like printf, into a string.
__attribute__((format(printf, 1, 2))) std::string format_text(const char* format, ...);

/// Joins texts: join({"a", "b"}, ", ") is "a, b".
std::string join(const std::vector<std::string>& texts, const std::string& separator);

/// Finds the name that a misspelt one probably means: the candidate with the smallest edit
/// distance; empty when every candidate differs in more than a third of the letters.
std::string nearest_name(const std::string& name, const std::set<std::string>& candidates);

/// "; did you mean 'NAME'?", or empty.
std::string did_you_mean(const std::string& name, const std::set<std::string>& candidates);

/// A name in quotation marks.
inline std::string quoted(const std::string& name) { return "'" + name + "'"; }

}  // namespace ist
