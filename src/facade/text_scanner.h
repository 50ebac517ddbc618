#pragma once

#include <locale.h>
#include <algorithm>
#include <cstddef>
#include <cstdlib>
#include <sstream>
#include <string>
#include <vector>

namespace ist {

/// Reads lines, words and numbers of a file's bytes, whatever the process's locale.
class TextScanner {
 public:
  explicit TextScanner(const std::string& bytes) : bytes_(bytes) {}

  std::size_t at() const { return at_; }  ///< [bytes] read so far
  bool at_end() const { return at_ >= bytes_.size(); }
  std::size_t line() const { return line_; }  ///< number of the line read last, from 1

  /// The words of the next line.
  std::vector<std::string> words() {
    const std::size_t end = std::min(bytes_.find('\n', at_), bytes_.size());
    std::istringstream text(bytes_.substr(at_, end - at_));
    at_ = std::min(end + 1, bytes_.size());
    ++line_;
    std::vector<std::string> words;
    for (std::string word; text >> word;) words.push_back(word);
    return words;
  }

  /// The next number. @returns false where there is none
  bool number(double* value) {
    skip_space();
    if (at_end()) return false;
    static const locale_t kClassic = newlocale(LC_ALL_MASK, "C", nullptr);
    const char* begin = bytes_.c_str() + at_;  // ends in a 0, where strtod stops
    char* end = nullptr;
    *value = strtod_l(begin, &end, kClassic);
    if (end == begin) return false;
    at_ += static_cast<std::size_t>(end - begin);
    return true;
  }

  bool only_space_left() {
    skip_space();
    return at_end();
  }

 private:
  void skip_space() {
    while (at_ < bytes_.size()) {
      const char c = bytes_[at_];
      if (c != ' ' && c != '\t' && c != '\r' && c != '\n') return;
      if (c == '\n') ++line_;
      ++at_;
    }
  }

  const std::string& bytes_;
  std::size_t at_ = 0;
  std::size_t line_ = 0;
};

/// The text as a whole number. @returns false where it is none, or larger than `most`
inline bool parse_count(const std::string& text, std::size_t most, std::size_t* value) {
  if (text.empty() || text.size() > 15) return false;
  *value = 0;
  for (const char c : text) {
    if (c < '0' || c > '9') return false;
    *value = 10 * *value + static_cast<std::size_t>(c - '0');
  }
  return *value <= most;
}

}  // namespace ist
