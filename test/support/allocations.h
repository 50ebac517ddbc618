#pragma once

#include <atomic>
#include <cstddef>
#include <cstdlib>
#include <new>

/// Counts the program's allocations with `new`. Only one file of a program may include this, since
/// it replaces the global operators.
namespace ist::test {
inline std::atomic<long> allocations{0};
}

// Not inlined, because the compiler would warn of free() after new.
#define IST_NOINLINE __attribute__((noinline))
IST_NOINLINE void* operator new(std::size_t size) {
  ++ist::test::allocations;
  if (void* memory = std::malloc(size)) return memory;
  throw std::bad_alloc();
}
// std::stable_sort allocates with this one.
IST_NOINLINE void* operator new(std::size_t size, const std::nothrow_t& /*tag*/) noexcept {
  ++ist::test::allocations;
  return std::malloc(size);
}
IST_NOINLINE void* operator new(std::size_t size, std::align_val_t alignment) {
  ++ist::test::allocations;
  const auto unit = static_cast<std::size_t>(alignment);
  if (void* memory = std::aligned_alloc(unit, (size + unit - 1) / unit * unit)) return memory;
  throw std::bad_alloc();
}
IST_NOINLINE void operator delete(void* memory) noexcept { std::free(memory); }
IST_NOINLINE void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
IST_NOINLINE void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
IST_NOINLINE void operator delete(void* memory, std::size_t, std::align_val_t) noexcept {
  std::free(memory);
}
