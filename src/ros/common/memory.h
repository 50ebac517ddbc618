#pragma once

#ifdef __GLIBC__
#include <malloc.h>
#endif

namespace ist {

/// Returns free memory to the system; the allocator of glibc keeps what many small objects used.
inline void return_free_memory() {
#ifdef __GLIBC__
  malloc_trim(0);
#endif
}

}  // namespace ist
