#include "fly/report/plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "engine/core/escape_html.h"
#include "engine/core/plain_number.h"

namespace terrace::fly {
namespace {

constexpr double kFigureWidth = 640, kFigureHeight = 250;
constexpr double kLeft = 52, kRight = 12, kTop = 14, kBottom = 28;
constexpr double kPlotWidth = kFigureWidth - kLeft - kRight, kPlotHeight = kFigureHeight - kTop - kBottom;

// "0.05", "12", "3.4k", "12M"
std::string Short(double value) {
  const double size = std::abs(value);
  if (size >= 1e9) return PlainNumber(value / 1e9, 3) + "G";
  if (size >= 1e6) return PlainNumber(value / 1e6, 3) + "M";
  if (size >= 1e4) return PlainNumber(value / 1e3, 3) + "k";
  return PlainNumber(value, 4);
}

class Scale {
 public:
  Scale(double low, double high, bool is_logarithmic) : low_(low), high_(high), logarithmic_(is_logarithmic) {}

  double Y(double value) const {
    const double fraction = logarithmic_ ? std::log(std::max(value, low_) / low_) / std::log(high_ / low_)
                                         : (value - low_) / (high_ - low_);
    return kTop + kPlotHeight * (1 - std::clamp(fraction, 0.0, 1.0));
  }

  std::vector<double> Ticks() const {
    std::vector<double> ticks;
    if (logarithmic_) {
      for (double tick = low_; tick <= high_ * 1.001; tick *= 10) ticks.push_back(tick);
    } else {
      for (int i = 0; i <= 4; ++i) ticks.push_back(low_ + (high_ - low_) * i / 4);
    }
    return ticks;
  }

 private:
  double low_, high_;
  bool logarithmic_;
};

void AddGrid(const Scale& scale, std::string& svg) {
  for (const double tick : scale.Ticks()) {
    const double y = scale.Y(tick);
    fmt::format_to(
        std::back_inserter(svg),
        R"(<line class="grid" x1="{:.1f}" x2="{:.1f}" y1="{:.1f}" y2="{:.1f}"/><text class="tick" x="{:.1f}" y="{:.1f}" text-anchor="end">{}</text>)",
        kLeft, kFigureWidth - kRight, y, y, kLeft - 6, y + 4, Short(tick));
  }
}

void AddTimeTicks(std::size_t seconds, std::string& svg) {
  const double step = RoundUp(static_cast<double>(seconds) / 10);
  for (double t = 0; t <= static_cast<double>(seconds) + 1e-9; t += step) {
    const double x = kLeft + kPlotWidth * t / static_cast<double>(seconds);
    fmt::format_to(std::back_inserter(svg),
                   R"(<text class="tick" x="{:.1f}" y="{:.1f}" text-anchor="middle">{}{}</text>)", x, kFigureHeight - 8,
                   PlainNumber(t), t == 0 ? " s" : "");
  }
}

void AddLine(const Series& series, const Scale& scale, double step, std::string& svg) {
  std::string points;
  const auto finish = [&] {
    if (!points.empty()) {
      fmt::format_to(std::back_inserter(svg), R"(<polyline class="line" stroke="{}" points="{}"/>)", series.color,
                     points);
    }
    points.clear();
  };
  for (std::size_t i = 0; i < series.values.size(); ++i) {
    if (std::isnan(series.values[i])) {
      finish();
      continue;
    }
    // Each value is a short horizontal line, so that a single one is visible too.
    const double x = kLeft + step * (static_cast<double>(i) + 0.5), y = scale.Y(series.values[i]);
    fmt::format_to(std::back_inserter(points), "{:.1f},{:.1f} {:.1f},{:.1f} ", x - 0.5, y, x + 0.5, y);
  }
  finish();
}

// Draws the values of the series on top of `base`, and adds them to it.
void AddStacked(const Series& series, const Scale& scale, double step, std::vector<double>& base, std::string& svg) {
  const double gap = series.shape == Series::Shape::kBars && step > 4 ? 1 : 0;
  std::string path;
  for (std::size_t i = 0; i < series.values.size(); ++i) {
    const double value = std::isnan(series.values[i]) ? 0 : series.values[i];
    if (value <= 0) continue;
    const double x = kLeft + step * static_cast<double>(i), bottom = scale.Y(base[i]), top = scale.Y(base[i] + value);
    fmt::format_to(std::back_inserter(path), "M{:.1f} {:.1f}h{:.1f}v{:.1f}h{:.1f}z", x + gap / 2, bottom, step - gap,
                   top - bottom, gap - step);
    base[i] += value;
  }
  if (!path.empty()) fmt::format_to(std::back_inserter(svg), R"(<path fill="{}" d="{}"/>)", series.color, path);
}

std::string Legend(const std::vector<Series>& series) {
  std::string html;
  for (const Series& one : series) {
    fmt::format_to(std::back_inserter(html), R"(<span class="key"><i style="background:{}"></i>{}</span>)", one.color,
                   EscapeHtml(one.name));
  }
  return html;
}

std::string Frame(const std::string& title, const std::string& unit, const std::string& note, const std::string& legend,
                  const std::string& svg) {
  return fmt::format(R"(<figure><figcaption><b>{}</b> <span class="unit">{}</span><p>{}</p><div>{}</div></figcaption>)"
                     R"(<svg viewBox="0 0 {:.0f} {:.0f}" role="img" aria-label="{}">{}</svg></figure>)",
                     EscapeHtml(title), EscapeHtml(unit), EscapeHtml(note), legend, kFigureWidth, kFigureHeight,
                     EscapeHtml(title), svg);
}

void AddAll(const std::vector<Series>& series, const Scale& scale, double step, std::size_t count, std::string& svg) {
  std::vector<double> base(count, 0);
  for (const Series& one : series) {
    if (one.shape != Series::Shape::kLine) AddStacked(one, scale, step, base, svg);
  }
  for (const Series& one : series) {
    if (one.shape == Series::Shape::kLine) AddLine(one, scale, step, svg);
  }
}

// The highest value of a line, or of the stack.
double Highest(const std::vector<Series>& series, std::size_t count) {
  std::vector<double> stack(count, 0);
  double highest = 0;
  for (const Series& one : series) {
    for (std::size_t i = 0; i < one.values.size(); ++i) {
      if (std::isnan(one.values[i])) continue;
      if (one.shape != Series::Shape::kLine) stack[i] += one.values[i];
      highest = std::max({highest, one.shape == Series::Shape::kLine ? one.values[i] : stack[i]});
    }
  }
  return highest;
}

}  // namespace

double RoundUp(double value) {
  if (!(value > 0)) return 1;
  const double decade = std::pow(10, std::floor(std::log10(value)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (value <= factor * decade * (1 + 1e-9)) return factor * decade;
  }
  return 10 * decade;
}

std::string SvgOf(const TimePlot& plot) {
  std::size_t count = 1;
  for (const Series& one : plot.series) count = std::max(count, one.values.size());
  double low = 0, high = std::max({Highest(plot.series, count), plot.min_top, plot.limit});
  if (plot.is_logarithmic) {
    high = std::pow(10, std::ceil(std::log10(std::max(high, 1e-3))));
    low = high;
    for (const Series& one : plot.series) {
      for (const double value : one.values) {
        if (value > 0) low = std::min(low, value);
      }
    }
    low = std::max(std::pow(10, std::floor(std::log10(low))), high / 1e5);
    if (low >= high) low = high / 10;
  } else {
    high = high > plot.min_top || high == 0 ? RoundUp(high) : high;
  }
  const Scale scale(low, high, plot.is_logarithmic);
  const double step = kPlotWidth / static_cast<double>(count);
  std::string svg;
  AddGrid(scale, svg);
  AddTimeTicks(count, svg);
  AddAll(plot.series, scale, step, count, svg);
  if (plot.limit >= 0) {
    const double y = scale.Y(plot.limit);
    fmt::format_to(
        std::back_inserter(svg),
        R"(<line class="limit" x1="{:.1f}" x2="{:.1f}" y1="{:.1f}" y2="{:.1f}"/><text class="limit" x="{:.1f}" y="{:.1f}" text-anchor="end">{}</text>)",
        kLeft, kFigureWidth - kRight, y, y, kFigureWidth - kRight - 4, y - 5, EscapeHtml(plot.limit_name));
  }
  for (const double mark : plot.marks) {
    const double x = kLeft + step * mark;
    fmt::format_to(std::back_inserter(svg),
                   R"(<line class="mark" x1="{:.1f}" x2="{:.1f}" y1="{:.1f}" y2="{:.1f}"><title>{}</title></line>)", x,
                   x, kTop, kFigureHeight - kBottom, EscapeHtml(plot.marks_name));
  }
  std::string legend = Legend(plot.series);
  if (!plot.marks.empty())
    legend += R"(<span class="key"><i class="mark"></i>)" + EscapeHtml(plot.marks_name) + "</span>";
  return Frame(plot.title, plot.unit, plot.note, legend, svg);
}

std::string SvgOf(const BarPlot& plot) {
  const std::size_t count = std::max<std::size_t>(1, plot.labels.size());
  const Scale scale(0, RoundUp(Highest(plot.series, count)), false);
  const double step = kPlotWidth / static_cast<double>(count);
  std::string svg;
  AddGrid(scale, svg);
  for (std::size_t i = 0; i < plot.labels.size(); ++i) {
    fmt::format_to(std::back_inserter(svg),
                   R"(<text class="tick" x="{:.1f}" y="{:.1f}" text-anchor="middle">{}</text>)",
                   kLeft + step * (static_cast<double>(i) + 0.5), kFigureHeight - 8, EscapeHtml(plot.labels[i]));
  }
  AddAll(plot.series, scale, step, count, svg);
  return Frame(plot.title, plot.unit, plot.note, Legend(plot.series), svg);
}

}  // namespace terrace::fly
