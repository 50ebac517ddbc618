#pragma once

#include <stdexcept>
#include <string>

namespace ist {

/// What a user's file, URDF or parameter got wrong: the message says what, where, which value and
/// what to do. Thrown while a model is loaded, never by a query.
class ModelError : public std::runtime_error {
 public:
  explicit ModelError(const std::string& message) : std::runtime_error(message) {}
};

}  // namespace ist
