#pragma once

#include <string>
#include <vector>

/// Tables of doc/packing.md.
namespace ist::benchmark {

/// A Markdown table that can be made in parts: rows that are measured again are replaced, the
/// others stay. The line below the table states the machine and the commits.
class Table {
 public:
  using Row = std::vector<std::string>;

  /// @param name     of the marks in the document: `<!-- NAME -->` and `<!-- end of NAME -->`
  /// @param columns  heads; the first `keys` of them identify a row
  Table(std::string name, Row columns, std::size_t keys);

  /// Reserves the next place for the row with this key: rows come in the order of their places.
  void place(const Row& key) { places_.push_back(key); }
  /// Adds a row whose key has a place, and prints it to standard error.
  void add(const Row& row);

  /// Prints the table to standard output.
  void print() const;
  /// @returns false, with a message, when the document lacks the marks
  bool write(const std::string& document) const;

 private:
  Row key_of(const Row& row) const;
  std::string text(const std::vector<Row>& rows) const;

  std::string name_;
  Row columns_;
  std::size_t keys_;
  std::vector<Row> places_, rows_;
};

/// Formats one value as printf does.
std::string text(const char* format, double value);

/// Formats two lengths [m] in mm: "1.23 / 0.45".
std::string gaps(double largest, double mean);

}  // namespace ist::benchmark
