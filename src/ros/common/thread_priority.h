#pragma once

#include <sys/resource.h>

namespace ist {

/// Gives the calling thread a low priority. Where cores are short it gets a tenth of what others
/// get, so it yields to cycles and still comes to an end. On Linux the nice value belongs to the
/// thread. There is no way back. Where the system refuses, the thread keeps its priority.
inline void lower_thread_priority() {
  constexpr int kNice = 10;
  (void)setpriority(PRIO_PROCESS, 0, kNice);
}

}  // namespace ist
