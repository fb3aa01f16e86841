#include "tests/bench/table.h"

#include <fmt/format.h>

#include <algorithm>

#include "engine/core/check.h"

namespace terrace::bench {

Cell Count(std::size_t count) { return {fmt::format("{}", count), count}; }
Cell Milliseconds(double seconds) { return {fmt::format("{:.2f}", seconds * 1e3), seconds * 1e3}; }
Cell Ratio(double ratio) { return {fmt::format("{:.2f}x", ratio), ratio}; }
Cell Percent(double share) { return {fmt::format("{:+.2f} %", share * 100), share}; }
Cell Number(double value, int digits) { return {fmt::format("{:.{}g}", value, digits), value}; }
Cell Number(double value, const char* unit, int digits) {
  return {fmt::format("{:.{}g} {}", value, digits, unit), value};
}

void Table::Add(std::vector<Cell> row) {
  TERRACE_CHECK(row.size() <= columns_.size());
  row.resize(columns_.size());
  rows_.push_back(std::move(row));
}

std::string Table::Markdown() const {
  std::vector<std::size_t> widths;
  for (std::size_t i = 0; i < columns_.size(); ++i) {
    widths.push_back(columns_[i].size());
    for (const std::vector<Cell>& row : rows_) widths[i] = std::max(widths[i], row[i].text.size());
  }
  std::string text;
  const auto line = [&](const auto& text_of) {
    for (std::size_t i = 0; i < columns_.size(); ++i) text += fmt::format("| {:<{}} ", text_of(i), widths[i]);
    text += "|\n";
  };
  line([&](std::size_t i) { return columns_[i]; });
  line([&](std::size_t i) { return std::string(widths[i], '-'); });
  for (const std::vector<Cell>& row : rows_) line([&](std::size_t i) { return row[i].text; });
  return text;
}

void Table::Print(std::ostream& out) const { out << "### " << title_ << "\n\n" << Markdown() << std::endl; }

nlohmann::ordered_json Table::Json() const {
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  for (const std::vector<Cell>& row : rows_) {
    nlohmann::ordered_json object;
    for (std::size_t i = 0; i < columns_.size(); ++i) {
      if (!row[i].value.is_null()) object[columns_[i]] = row[i].value;
    }
    rows.push_back(std::move(object));
  }
  return {{"id", id_}, {"title", title_}, {"rows", std::move(rows)}, {"markdown", Markdown()}};
}

}  // namespace terrace::bench
