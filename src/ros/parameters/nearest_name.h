#pragma once

#include <cstddef>
#include <set>
#include <string>

namespace ist {

/// Levenshtein distance: the number of insertions, deletions and replacements that turn `a` into
/// `b`.
/// @param limit  returned where it is as many or more, which is found sooner
std::size_t edit_distance(const std::string& a, const std::string& b, std::size_t limit);

/// Finds the name that a misspelt one probably means: the candidate with the smallest edit
/// distance; empty when every candidate differs in more than a third of the letters.
std::string nearest_name(const std::string& name, const std::set<std::string>& candidates);

}  // namespace ist
