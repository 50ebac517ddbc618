#pragma once

#include <sys/resource.h>

namespace ist {

/// Gives the calling thread the lowest ordinary priority (on Linux the nice value belongs to the
/// thread): it yields to every other thread, and goes on where a core is free. There is no way
/// back. Where the system refuses, the thread keeps its priority.
inline void lower_thread_priority() {
  constexpr int kLowest = 19;
  (void)setpriority(PRIO_PROCESS, 0, kLowest);
}

}  // namespace ist
