#include "archive/unit_name.h"

#include <fmt/format.h>

#include <charconv>

namespace terrace::archive {
namespace {

constexpr std::string_view kTop = "top";

bool TakeNumber(std::string_view& text, std::int64_t& number) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc()) return false;
  text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  return true;
}

bool TakeHyphen(std::string_view& text) {
  if (!text.starts_with('-')) return false;
  text.remove_prefix(1);
  return true;
}

}  // namespace

std::string UnitNameOf(const geo::TileKey& key) {
  if (key.level < kTopLevels) return std::string(kTop);
  const int below = key.level - kTopLevels;
  return fmt::format("{}-{}-{}", kTopLevels, key.x >> below, key.y >> below);
}

Result<std::optional<geo::TileKey>> UnitRoot(std::string_view name) {
  if (name == kTop) return std::nullopt;
  geo::TileKey root;
  std::int64_t level = 0;
  std::string_view rest = name;
  if (TakeNumber(rest, level) && level == kTopLevels && TakeHyphen(rest) && TakeNumber(rest, root.x) &&
      TakeHyphen(rest) && TakeNumber(rest, root.y) && rest.empty()) {
    root.level = kTopLevels;
    if (geo::IsValid(root) && UnitNameOf(root) == name) return root;
  }
  return MakeError(ErrorCode::kInvalidArgument, "'{}' is no name of a unit; names are top and {}-X-Y", name,
                   kTopLevels);
}

std::string UnitPath(std::string_view name) {
  if (name == kTop) return fmt::format("{}.pmtiles", name);
  return fmt::format("units/{}.pmtiles", name);
}

}  // namespace terrace::archive
