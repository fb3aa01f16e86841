// Curves for a plot; tools/plot_paper.py draws them.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

namespace terrace::bench {

struct Series {
  std::string name;
  std::vector<std::pair<double, double>> points;
  bool is_reference = false;  // numbers of another program, drawn as marks and not as a line
};

// Both axes are logarithmic.
struct Figure {
  std::string id;  // name of the file
  std::string title, x_label, y_label;
  std::vector<Series> series;

  nlohmann::ordered_json Json() const {
    nlohmann::ordered_json json{{"id", id}, {"title", title}, {"x", x_label}, {"y", y_label}};
    for (const Series& s : series) {
      json["series"].push_back({{"name", s.name}, {"points", s.points}, {"reference", s.is_reference}});
    }
    return json;
  }
};

}  // namespace terrace::bench
