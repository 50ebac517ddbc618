#pragma once

#include <string>
#include <vector>

namespace ist {

/// The add-ons that the node is built with, by the names of their folders.
const std::vector<std::string>& built_add_ons();

}  // namespace ist
