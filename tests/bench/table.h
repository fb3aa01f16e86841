// A table of results: Markdown for people, JSON for programs.
#pragma once

#include <cstddef>
#include <nlohmann/json.hpp>
#include <ostream>
#include <string>
#include <vector>

namespace terrace::bench {

// One cell: the printed text, and the value in the JSON file.
struct Cell {
  Cell() = default;  // empty
  Cell(std::string shown) : text(std::move(shown)), value(text) {}
  Cell(const char* shown) : Cell(std::string(shown)) {}
  Cell(std::string shown, nlohmann::ordered_json held) : text(std::move(shown)), value(std::move(held)) {}

  std::string text;
  nlohmann::ordered_json value;
};

Cell Count(std::size_t count);
Cell Milliseconds(double seconds);
Cell Ratio(double ratio);               // "3.42x"
Cell Percent(double share);             // of 1: "-12.3 %", always with its sign
Cell Number(double value, int digits);  // significant digits
Cell Number(double value, const char* unit, int digits);

class Table {
 public:
  // `id` names the table in files. `columns` are the headings, and the keys in JSON.
  Table(std::string id, std::string title, std::vector<std::string> columns)
      : id_(std::move(id)), title_(std::move(title)), columns_(std::move(columns)) {}

  // Missing cells at the end are empty.
  void Add(std::vector<Cell> row);
  bool empty() const { return rows_.empty(); }

  std::string Markdown() const;  // only the rows
  void Print(std::ostream& out) const;
  nlohmann::ordered_json Json() const;

 private:
  std::string id_, title_;
  std::vector<std::string> columns_;
  std::vector<std::vector<Cell>> rows_;
};

}  // namespace terrace::bench
