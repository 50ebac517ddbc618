#pragma once

#include <exception>
#include <functional>

namespace ist {

/// Work of many seconds that its caller has cancelled. It never leaves the library.
class Cancelled : public std::exception {
 public:
  const char* what() const noexcept override { return "cancelled"; }
};

/// True ends the work. It is called every few milliseconds; it may be empty.
using CancelRequest = std::function<bool()>;

/// @throws Cancelled when the request says so
inline void throw_if(const CancelRequest& cancelled) {
  if (cancelled && cancelled()) throw Cancelled();
}

}  // namespace ist
