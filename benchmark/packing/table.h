#pragma once

#include <string>
#include <vector>

/// Tables of doc/packing.md.
namespace ist::benchmark {

/// A Markdown table that can be made in parts: rows that were measured before stay, those that are
/// measured again are replaced. The line below it says where and at which commits.
class Table {
 public:
  using Row = std::vector<std::string>;

  /// @param name     of the marks in the document: `<!-- NAME -->` and `<!-- end of NAME -->`
  /// @param columns  heads; the first `keys` of them tell a row from the others
  Table(std::string name, Row columns, std::size_t keys);

  /// Where a row stands among the others: rows come in the order of their places.
  void place(const Row& key) { places_.push_back(key); }
  /// Said on standard error at once. Its key must have a place.
  void add(const Row& row);

  /// On standard output.
  void print() const;
  /// @returns false, and says why, when the document lacks the marks
  bool write(const std::string& document) const;

 private:
  Row key_of(const Row& row) const;
  std::string text(const std::vector<Row>& rows) const;

  std::string name_;
  Row columns_;
  std::size_t keys_;
  std::vector<Row> places_, rows_;
};

/// printf for one value.
std::string text(const char* format, double value);

/// "1.23 / 0.45": two lengths [m] in mm.
std::string gaps(double largest, double mean);

}  // namespace ist::benchmark
