// Parses the parameters of a height request from a query, a form or JSON. Points are parsed one by one: a list is read
// only up to its first error or to the limit, and is never stored as text.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "engine/core/result.h"
#include "engine/dem/elevation_model.h"
#include "server/query/parameters.h"

namespace terrace::server {

// Each parameter may occur once; `v` is ignored. Errors are kInvalidArgument. The message is for the client; it names
// the parameter and the item, and quotes no text of the client.
class HeightsParameters final : public ParameterSink {
 public:
  enum Text {
    kStep,
    kSamples,
    kDatum,
    kCertify,
    kNormals,
    kSurface,
    kLevel,
    kError,
    kFraction,
    kAtLeast,
    kFormat,
    kCompression,
    kTexts
  };

  // Limit for the text of one point, and of any value that is not a list. Two numbers with all digits take 50 bytes.
  static constexpr std::size_t kMaxItemBytes = 1000;

  // `text_bytes`: approximate size of the input, to reserve memory for points.
  HeightsParameters(std::size_t max_locations, std::size_t text_bytes)
      : max_locations_(max_locations), text_bytes_(text_bytes) {}

  Result<void> AddToName(std::string_view part) override;
  Result<void> EndName() override;
  Result<void> AddToValue(std::string_view part) override;
  Result<void> EndValue() override;
  std::string_view JsonExample() const override { return R"({"locations": "46.5,8.1|46.6,8.2"})"; }

  // The points of `locations` or the corners of `path`; never both. TakePoints may be called once.
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
  Text text_ = kStep;              // the parameter, if target_ is kText
  std::string item_;               // of the current value: a point, or a whole short text
  const char* points_of_ = nullptr;
  bool is_path_ = false;
  std::vector<dem::GeoPosition> points_;
  std::array<std::optional<std::string>, kTexts> texts_;
};

// Parses the whole text, apart from blanks, as a finite number.
std::optional<double> NumberOf(std::string_view text);

// kInvalidArgument: more points than one request may have.
tl::unexpected<Error> TooManyPoints(const char* parameter, std::size_t max_locations);

}  // namespace terrace::server
