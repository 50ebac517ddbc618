#pragma once

#include <cstdio>
#include <fstream>
#include <string>

#include "support/accuracy.h"

namespace ist::benchmark {

/// Writes a table between its marks in a document. Returns false with a message on standard error
/// if it cannot.
inline bool write_table(const std::string& document, const std::string& name,
                        const std::string& table) {
  std::string all = test::read_text(document);
  const auto [first, last] = test::table_place(all, name);
  if (last != 0) {
    all.replace(first, last - first, table);
    if (std::ofstream(document) << all) return true;
  }
  std::fprintf(stderr, "%s cannot be written, or lacks the marks of '%s'\n", document.c_str(),
               name.c_str());
  return false;
}

}  // namespace ist::benchmark
