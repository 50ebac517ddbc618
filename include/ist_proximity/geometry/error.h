#pragma once

#include <stdexcept>
#include <string>

namespace ist {

/// A user's file, URDF or parameter is wrong. The message says what is wrong, where, which value it
/// has and what to do. Thrown while a model is loaded, never by a query.
class ModelError : public std::runtime_error {
 public:
  /// @param message  one or more sentences for the user
  explicit ModelError(const std::string& message) : std::runtime_error(message) {}
};

}  // namespace ist
