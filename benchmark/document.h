#pragma once

#include <cstdio>
#include <fstream>
#include <string>

#include "support/accuracy.h"

namespace ist::benchmark {

/// Puts a table between the marks of its name in a document; says so when it cannot.
inline bool write_table(const std::string& path, const std::string& name,
                        const std::string& table) {
  std::string document = test::read_text(path);
  const auto [first, last] = test::table_place(document, name);
  if (last == 0) {
    std::fprintf(stderr, "%s cannot be read, or lacks the marks of '%s'\n", path.c_str(),
                 name.c_str());
    return false;
  }
  document.replace(first, last - first, table);
  if (std::ofstream(path) << document) return true;
  std::fprintf(stderr, "%s cannot be written\n", path.c_str());
  return false;
}

}  // namespace ist::benchmark
