#pragma once

#include <time.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <future>
#include <iomanip>
#include <sstream>
#include <string>
#include <thread>
#include <type_traits>
#include <utility>
#include <vector>

#include "support/accuracy.h"
#include "support/data_dir.h"

namespace ist::benchmark {

/// The test data's folder. Ends the program with a message if there is none.
inline std::filesystem::path data_or_exit() {
  if (const auto data = test::data_dir()) return *data;
  std::fprintf(stderr, "%s\n", test::kNoData.c_str());
  std::exit(1);
}

/// A text of values, as std::printf writes them.
template <class... Values>
std::string text_of(const char* format, const Values&... values) {
  std::array<char, 1000> text{};
  std::snprintf(text.data(), text.size(), format, values...);
  return text.data();
}

/// A program's options, and the document that its tables are put into.
class CommandLine : public CLI::App {
 public:
  explicit CommandLine(const std::string& what) : CLI::App(what) {
    option_defaults()->always_capture_default();
    add_option("--update-doc", document_, "Document whose tables are written");
  }

  /// Ends the program where the words ask for help, or are wrong.
  void read(int argc, char** argv) {
    try {
      parse(argc, argv);
    } catch (const CLI::ParseError& error) {
      std::exit(exit(error));
    }
  }

  /// Prints a table and puts it between its marks in the document.
  /// @returns the program's exit code: 1 with a message where the document cannot be written
  int publish(const std::string& name, const std::string& table) const {
    std::printf("%s", table.c_str());
    std::fflush(stdout);
    if (document_.empty() || test::replace_table(document_, name, table)) return 0;
    std::fprintf(stderr, "%s cannot be written, or lacks the marks of '%s'\n", document_.c_str(),
                 name.c_str());
    return 1;
  }

 private:
  std::string document_;
};

/// A CSV file. The names of the first row's values become its header.
class CsvFile {
 public:
  /// Ends the program with a message if the file cannot be written.
  explicit CsvFile(const std::string& path) : file_(path) {
    if (file_) return;
    std::fprintf(stderr, "cannot write %s\n", path.c_str());
    std::exit(2);
  }

  template <class Value>
  CsvFile& add(const std::string& name, const Value& value) {
    const char* comma = row_.tellp() > 0 ? "," : "";
    header_ += comma + name;
    if constexpr (std::is_convertible_v<Value, std::string>) {
      row_ << comma << std::quoted(std::string(value));
    } else {
      row_ << comma << value;
    }
    return *this;
  }
  void end_row() {
    if (!has_header_) file_ << header_ << "\n";
    has_header_ = true;
    file_ << row_.str() << "\n" << std::flush;
    row_.str("");
    header_.clear();
  }

 private:
  std::ofstream file_;
  std::ostringstream row_;
  std::string header_;
  bool has_header_ = false;
};

/// Calls `work` for 0 to count - 1, in as many threads as the machine has.
inline void for_each(std::size_t count, const std::function<void(std::size_t)>& work) {
  std::atomic<std::size_t> next{0};
  std::vector<std::future<void>> threads;
  for (unsigned t = 0; t < std::max(1U, std::thread::hardware_concurrency()); ++t) {
    threads.push_back(std::async(std::launch::async, [&] {
      for (std::size_t i = next++; i < count; i = next++) work(i);
    }));
  }
}

using Clock = std::chrono::steady_clock;

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
