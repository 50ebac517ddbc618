#pragma once

#include <pthread.h>

#include <string>

namespace ist {

/// Names the calling thread, as `top -H` and debuggers show it; Linux keeps 15 characters.
inline void name_thread(const std::string& name) {
  pthread_setname_np(pthread_self(), name.substr(0, 15).c_str());
}

}  // namespace ist
