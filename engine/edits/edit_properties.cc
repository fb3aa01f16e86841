#include "engine/edits/edit_properties.h"

#include <fmt/format.h>

#include <algorithm>

namespace terrace::dem {

using nlohmann::json;

tl::expected<EditDatum, std::string> ParseDatum(const json& value) {
  constexpr std::array<const char*, 2> kNames = {"ellipsoid", "orthometric"};
  if (value == kNames[0]) return EditDatum::kEllipsoid;
  if (value == kNames[1]) return EditDatum::kOrthometric;
  const std::string hint = value.is_string() ? NearestOf(value.get<std::string>(), kNames) : "";
  return tl::unexpected(
      fmt::format("vertical is {}; it must be \"ellipsoid\", or \"orthometric\" for heights above the geoid of the "
                  "sources{}",
                  value.dump(), hint));
}

tl::expected<std::string, std::string> ParseSourceVertical(const json& value) {
  constexpr std::array<const char*, 5> kNames = {"crs", "unknown", "ellipsoid", "egm96", "egm2008"};
  if (std::ranges::find(kNames, value) != kNames.end()) return value.get<std::string>();
  if (value.is_string() && value.get<std::string>().starts_with("EPSG:")) return value.get<std::string>();
  return tl::unexpected(
      fmt::format("vertical is {}; of a source it is \"crs\", \"unknown\", \"ellipsoid\", \"egm96\", \"egm2008\" or a "
                  "vertical reference system such as \"EPSG:5703\"",
                  value.dump()));
}

}  // namespace terrace::dem
