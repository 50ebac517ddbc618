#pragma once

#include <pthread.h>
#include <sys/resource.h>

#include <string>

namespace ist {

/// Names the calling thread, as `top -H` and debuggers show it; Linux keeps 15 characters.
inline void name_thread(const std::string& name) {
  pthread_setname_np(pthread_self(), name.substr(0, 15).c_str());
}

/// Gives the calling thread a low priority. Where cores are short it gets a tenth of what others
/// get, so it yields to cycles and still comes to an end. On Linux the nice value belongs to the
/// thread. There is no way back. Where the system refuses, the thread keeps its priority.
inline void lower_thread_priority() {
  constexpr int kNice = 10;
  (void)setpriority(PRIO_PROCESS, 0, kNice);
}

}  // namespace ist
