#pragma once

#include <cstdint>
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

/// Asks now and then, in a loop of many short steps.
class CancelWatch {
 public:
  /// @param cancelled  outlives this
  explicit CancelWatch(const CancelRequest& cancelled) : cancelled_(cancelled) {
    throw_if(cancelled);
  }
  /// @throws Cancelled when the request says so
  void step() {
    constexpr std::uint32_t kAskEvery = 1U << 13U;  // steps of up to a microsecond
    if (++steps_ % kAskEvery == 0) throw_if(cancelled_);
  }

 private:
  const CancelRequest& cancelled_;
  std::uint32_t steps_ = 0;
};

}  // namespace ist
