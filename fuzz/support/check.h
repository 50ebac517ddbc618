#pragma once

#include <cstdio>
#include <cstdlib>

/// Ends the program where a fuzz target finds that something promised does not hold; libFuzzer then
/// keeps the input. The arguments of printf() that follow tell the values.
#define FUZZ_CHECK(condition, ...)                                                        \
  do {                                                                                    \
    if (!(condition)) {                                                                   \
      std::fprintf(stderr, "%s:%d: does not hold: %s: ", __FILE__, __LINE__, #condition); \
      std::fprintf(stderr, __VA_ARGS__);                                                  \
      std::fprintf(stderr, "\n");                                                         \
      std::abort();                                                                       \
    }                                                                                     \
  } while (false)
