// The parameters of a request for heights, read from a query, a form or JSON as they arrive: points are understood one
// by one, so that a list is read to its first fault or to the limit and is never held as text.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "engine/core/result.h"
#include "engine/dem/dem_source.h"
#include "server/query/parameters.h"

namespace terrace::server {

// Each parameter at most once, except `v`, which is ignored. Errors are kInvalidArgument with a message for the client
// that names the parameter and the item, and has nothing of the client's text in it.
class HeightsParameters final : public ParameterSink {
 public:
  enum Text { kStep, kSamples, kDatum, kCertify, kTexts };

  // Longest text of one point, and of any value but a list; two numbers with all their digits take 50.
  static constexpr std::size_t kMaxItemBytes = 1000;

  // `text_bytes`: about how much there is to read, for the memory of points.
  HeightsParameters(std::size_t max_locations, std::size_t text_bytes)
      : max_locations_(max_locations), text_bytes_(text_bytes) {}

  Result<void> AddToName(std::string_view part) override;
  Result<void> EndName() override;
  Result<void> AddToValue(std::string_view part) override;
  Result<void> EndValue() override;

  // `locations`, or the corners of `path`; never both. Taken once.
  bool has_points() const { return points_of_ != nullptr; }
  bool is_path() const { return is_path_; }
  std::vector<dem::GeoPosition> TakePoints() { return std::move(points_); }
  const std::optional<std::string>& text(Text which) const { return texts_[which]; }

 private:
  enum class Target { kNone, kPoints, kText };

  Result<void> AddToItem(std::string_view part);
  Result<void> EndPoint();

  const std::size_t max_locations_, text_bytes_;
  std::string name_;
  Target target_ = Target::kNone;  // of the current value
  Text text_ = kStep;              // which, of a kText
  std::string item_;               // of the current value: a point, or the whole of a short text
  const char* points_of_ = nullptr;
  bool is_path_ = false;
  std::vector<dem::GeoPosition> points_;
  std::array<std::optional<std::string>, kTexts> texts_;
};

// The whole text, but for blanks, as a finite number.
std::optional<double> NumberOf(std::string_view text);

// kInvalidArgument: more points than one request may have.
tl::unexpected<Error> TooManyPoints(const char* parameter, std::size_t max_locations);

}  // namespace terrace::server
