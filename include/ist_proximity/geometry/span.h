#pragma once

#include <array>
#include <cassert>
#include <cstddef>
#include <initializer_list>
#include <type_traits>
#include <vector>

namespace ist {

/// A view of consecutive elements that somebody else owns: a pointer and a count, as C++20's
/// std::span. It also views a braced list, as C++26's does, so that a call may be written
/// `run(X_FL, known, {&snapshot}, &results)` without an allocation; such a view lives no longer
/// than the call.
template <typename T>
class Span {
 public:
  /// The elements' type, without const.
  using value_type = std::remove_cv_t<T>;

  Span() = default;
  /// The `size` elements that begin at `data`.
  Span(T* data, std::size_t size) : data_(data), size_(size) {}
  /// The elements of a vector or an array; not of vector<bool>, which has none.
  template <typename Container, typename = std::enable_if_t<std::is_convertible_v<
                                    decltype(std::declval<Container&>().data()), T*>>>
  Span(Container&& container)  // NOLINT(google-explicit-constructor): as std::span
      : data_(container.data()), size_(container.size()) {}
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Winit-list-lifetime"  // documented above
#endif
  /// The elements of a braced list; valid until the end of the call that the list is written in.
  template <typename U = T, typename = std::enable_if_t<std::is_const_v<U>>>
  Span(std::initializer_list<value_type> list)  // NOLINT(google-explicit-constructor): as std::span
      : data_(list.begin()), size_(list.size()) {}
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic pop
#endif

  T* data() const { return data_; }           ///< the first element; may be null when empty
  std::size_t size() const { return size_; }  ///< elements
  bool empty() const { return size_ == 0; }   ///< whether there are no elements
  T* begin() const { return data_; }          ///< iterator at the first element
  T* end() const { return data_ + size_; }    ///< iterator past the last element
  /// Element i < size().
  T& operator[](std::size_t i) const {
    assert(i < size_);
    return data_[i];
  }

 private:
  T* data_ = nullptr;
  std::size_t size_ = 0;
};

}  // namespace ist
