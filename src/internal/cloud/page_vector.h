#pragma once

#include <sys/mman.h>

#include <cstddef>
#include <new>
#include <type_traits>
#include <utility>
#include <vector>

namespace ist {

/// Memory for the arrays of an index, which are reserved for any cloud and used in part. A large
/// array gets pages of its own from the system: a page takes memory once something is written to
/// it, and all are returned when the array is freed. The heap would give out pages that were in use
/// before, and keep them. Elements are not initialized, so that their pages stay unused.
template <typename T>
class PageAllocator {
 public:
  using value_type = T;

  PageAllocator() = default;
  template <typename U>
  explicit PageAllocator(const PageAllocator<U>& /*other*/) {}

  T* allocate(std::size_t n) {
    const std::size_t bytes = n * sizeof(T);
    if (!has_own_pages(n)) return static_cast<T*>(::operator new(bytes, kAlignment));
    void* const pages =
        mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (pages == MAP_FAILED) throw std::bad_alloc();
    return static_cast<T*>(pages);
  }
  void deallocate(T* data, std::size_t n) {
    if (has_own_pages(n)) {
      munmap(data, n * sizeof(T));
    } else {
      ::operator delete(data, kAlignment);
    }
  }
  template <typename U, typename... Arguments>
  void construct(U* at, Arguments&&... arguments) {
    if constexpr (sizeof...(Arguments) == 0) {
      ::new (static_cast<void*>(at)) U;  // no parentheses: not initialized
    } else {
      ::new (static_cast<void*>(at)) U(std::forward<Arguments>(arguments)...);
    }
  }

  friend bool operator==(const PageAllocator& /*a*/, const PageAllocator& /*b*/) { return true; }
  friend bool operator!=(const PageAllocator& /*a*/, const PageAllocator& /*b*/) { return false; }

 private:
  static_assert(std::is_trivially_default_constructible_v<T>, "elements are not initialized");
  static_assert(std::is_trivially_destructible_v<T>, "pages are returned as they are");
  static constexpr std::align_val_t kAlignment{alignof(T)};
  // Smaller arrays share pages with others: a system call for each would cost more than it saves.
  static constexpr std::size_t kOwnPages = std::size_t{1} << 20;  // [bytes]

  static bool has_own_pages(std::size_t n) { return n * sizeof(T) >= kOwnPages; }
};

/// A vector whose new elements are undefined.
template <typename T>
using PageVector = std::vector<T, PageAllocator<T>>;

}  // namespace ist
