#include "packing/table.h"

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <memory>
#include <sstream>
#include <thread>
#include <utility>

#include "support/accuracy.h"

namespace ist::benchmark {
namespace {

std::string output_of(const std::string& command) {
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> pipe(popen(command.c_str(), "r"), pclose);
  char line[256] = {};
  if (!pipe || std::fgets(line, sizeof line, pipe.get()) == nullptr) return "";
  std::string text = line;
  while (!text.empty() && text.back() == '\n') text.pop_back();
  return text;
}

// The commit, with a + if the working tree differs.
std::string commit() {
  const std::string git = "git -C '" + std::string(IST_PROXIMITY_SOURCE_DIR) + "' ";
  const std::string hash = output_of(git + "rev-parse --short=10 HEAD 2> /dev/null");
  if (hash.empty()) return "unknown";
  const std::string changed =
      output_of(git + "status --porcelain --untracked-files=no -- src include benchmark");
  return hash + (changed.empty() ? "" : "+");
}

std::string machine() {
  const std::string model =
      output_of("sed -n 's/^model name[^:]*: //p' /proc/cpuinfo 2> /dev/null");
  return (model.empty() ? "unknown processor" : model) + ", " +
         std::to_string(std::thread::hardware_concurrency()) + " cores";
}

// "... at commit a, b." -> {a, b}
std::vector<std::string> commits_of(const std::string& block) {
  const std::string mark = " at commit ";
  const std::size_t at = block.find(mark), end = block.find(".\n", at);
  std::vector<std::string> commits;
  if (at == std::string::npos || end == std::string::npos) return commits;
  std::istringstream list(block.substr(at + mark.size(), end - at - mark.size()));
  for (std::string one; std::getline(list, one, ',');) {
    commits.push_back(one.substr(one.find_first_not_of(' ')));
  }
  return commits;
}

std::string line_of(const Table::Row& cells) {
  std::string line = "|";
  for (const std::string& cell : cells) line += cell.empty() ? " |" : " " + cell + " |";
  return line + "\n";
}

}  // namespace

Table::Table(std::string name, Row columns, std::size_t keys)
    : name_(std::move(name)), columns_(std::move(columns)), keys_(keys) {}

Table::Row Table::key_of(const Row& row) const {
  return {row.begin(), row.begin() + static_cast<std::ptrdiff_t>(keys_)};
}

void Table::add(const Row& row) {
  std::fprintf(stderr, "%s: %s", name_.c_str(), line_of(row).c_str());
  rows_.push_back(row);
}

std::string Table::text(const std::vector<Row>& rows) const {
  std::string table = line_of(columns_) + "|";
  for (std::size_t i = 0; i < columns_.size(); ++i) table += "---|";
  table += "\n";
  for (const Row& key : places_) {
    for (const Row& row : rows) {
      if (key_of(row) == key) table += line_of(row);
    }
  }
  return table;
}

void Table::print() const { std::printf("%s: %s\n\n", name_.c_str(), text(rows_).c_str()); }

bool Table::write(const std::string& document) const {
  if (rows_.empty()) return true;
  std::string all = test::read_text(document);
  const auto [first, last] = test::table_place(all, name_);
  if (last == 0) {
    std::fprintf(stderr, "%s lacks the marks of '%s'\n", document.c_str(), name_.c_str());
    return false;
  }
  std::vector<Row> rows = rows_;
  bool kept = false;
  for (const Row& old : test::parse_table(all, name_)) {
    const auto is_same = [&](const Row& row) { return key_of(row) == key_of(old); };
    const bool fits = old.size() == columns_.size() &&
                      std::find(places_.begin(), places_.end(), key_of(old)) != places_.end();
    if (!fits || std::any_of(rows_.begin(), rows_.end(), is_same)) continue;
    rows.push_back(old);
    kept = true;
  }
  std::vector<std::string> commits = {commit()};
  if (kept) {
    for (const std::string& old : commits_of(all.substr(first, last - first))) {
      if (old != commits.front()) commits.push_back(old);
    }
  }
  std::string where = machine() + ", at commit " + commits.front();
  for (std::size_t i = 1; i < commits.size(); ++i) where += ", " + commits[i];
  all.replace(first, last - first, text(rows) + "\n" + where + ".\n");
  std::ofstream(document) << all;
  return true;
}

std::string text(const char* format, double value) {
  char buffer[64];
  std::snprintf(buffer, sizeof buffer, format, value);
  return buffer;
}

std::string gaps(double largest, double mean) {
  return text("%.2f", 1e3 * largest) + " / " + text("%.2f", 1e3 * mean);
}

}  // namespace ist::benchmark
