// Plots as SVG: over the seconds of a flight, and bars with labels.
#pragma once

#include <string>
#include <vector>

namespace terrace::fly {

struct Series {
  std::string name;
  std::string color;                                              // a CSS colour or variable
  std::vector<double> values;                                     // one a second, or a label; NaN leaves a gap
  enum class Shape { kLine, kArea, kBars } shape = Shape::kLine;  // areas and bars are stacked in their order
};

struct TimePlot {
  std::string title;
  std::string unit;
  std::string note;  // one sentence below the title
  std::vector<Series> series;
  bool is_logarithmic = false;  // values below the lowest decade are drawn on it
  double limit = -1;            // a horizontal line; negative: none
  std::string limit_name = {};
  double min_top = 0;              // the scale ends at this value or above
  std::vector<double> marks = {};  // seconds; vertical lines
  std::string marks_name = {};
};

std::string SvgOf(const TimePlot& plot);

// Bars of equal width with a label below each.
struct BarPlot {
  std::string title, unit, note;
  std::vector<Series> series;  // stacked; a value for each label
  std::vector<std::string> labels = {};
};

std::string SvgOf(const BarPlot& plot);

// A round number at or above `value`: 1, 2 or 5 times a power of ten.
double RoundUp(double value);

}  // namespace terrace::fly
