#pragma once

#include <string>

namespace ist {

/// Removes the leading slash that older programs put before frame names; tf2 knows frames without
/// it. Names of nodes lose theirs in the same way.
inline std::string without_slash(const std::string& name) {
  return !name.empty() && name[0] == '/' ? name.substr(1) : name;
}

}  // namespace ist
