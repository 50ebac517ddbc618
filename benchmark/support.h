#pragma once

#include <time.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "support/data_dir.h"

namespace ist::benchmark {

/// The test data's folder. Ends the program with a message if there is none.
inline std::filesystem::path data_or_exit() {
  if (const auto data = test::data_dir()) return *data;
  std::fprintf(stderr, "%s\n", test::kNoData.c_str());
  std::exit(1);
}

/// The words of a command line.
class Arguments {
 public:
  Arguments(int argc, char** argv) : words_(argv + 1, argv + argc) {}

  /// Takes `--NAME VALUE` off the words. @returns the value; `otherwise` where it is not stated
  std::string text(const std::string& name, std::string otherwise = "") {
    const auto found = std::find(words_.begin(), words_.end(), "--" + name);
    if (found == words_.end() || found + 1 == words_.end()) return otherwise;
    otherwise = found[1];
    words_.erase(found, found + 2);
    return otherwise;
  }
  double number(const std::string& name, double otherwise) {
    const std::string value = text(name);
    return value.empty() ? otherwise : std::stod(value);
  }
  std::size_t count(const std::string& name, std::size_t otherwise) {
    return static_cast<std::size_t>(number(name, static_cast<double>(otherwise)));
  }

  /// What is left. Ends the program with a message where that holds an option.
  const std::vector<std::string>& rest() const {
    for (const std::string& word : words_) {
      if (word.rfind("--", 0) != 0) continue;
      std::fprintf(stderr, "unknown option, or one without its value: %s\n", word.c_str());
      std::exit(2);
    }
    return words_;
  }

 private:
  std::vector<std::string> words_;
};

/// Calls `work` for 0 to count - 1, in so many threads.
inline void for_each(std::size_t count, std::size_t threads,
                     const std::function<void(std::size_t)>& work) {
  std::atomic<std::size_t> next{0};
  const auto take = [&] {
    for (std::size_t i = next++; i < count; i = next++) work(i);
  };
  std::vector<std::thread> pool;
  for (std::size_t t = 1; t < threads; ++t) pool.emplace_back(take);
  take();
  for (std::thread& thread : pool) thread.join();
}

using Clock = std::chrono::steady_clock;

inline double microseconds_since(Clock::time_point start) {
  return 1e6 * std::chrono::duration<double>(Clock::now() - start).count();
}

/// Measures the processor time of this thread, so that other load on the machine does not count.
/// lap() returns [us] since the last call.
class ThreadTimer {
 public:
  ThreadTimer() { lap(); }
  double lap() {
    timespec now{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    const double us =
        1e6 * static_cast<double>(now.tv_sec) + 1e-3 * static_cast<double>(now.tv_nsec);
    return us - std::exchange(last_, us);
  }

 private:
  double last_ = 0.0;
};

inline double mean(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += value;
  return values.empty() ? 0.0 : sum / static_cast<double>(values.size());
}

/// The q-quantile, q from 0 to 1; 0 without values.
inline double quantile(std::vector<double> values, double q) {
  if (values.empty()) return 0.0;
  const auto at =
      std::min(values.size() - 1, static_cast<std::size_t>(q * static_cast<double>(values.size())));
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(at), values.end());
  return values[at];
}

}  // namespace ist::benchmark
