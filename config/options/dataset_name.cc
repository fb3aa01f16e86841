#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>
#include <string_view>

#include "config/config.h"
#include "config/input/json_text.h"
#include "config/options/option_table.h"

namespace terrace::config {
namespace {

constexpr std::size_t kMaxNameLength = 64;

constexpr std::array<std::string_view, 7> kReservedNames = {"datasets", "viewer",  "livez",       "readyz",
                                                            "metrics",  "version", "openapi.json"};

bool IsNameCharacter(char c) {
  return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '.' || c == '_' || c == '-';
}

bool IsReserved(std::string_view name) {
  return std::find(kReservedNames.begin(), kReservedNames.end(), name) != kReservedNames.end();
}

// URL parsers remove these two before a request is sent (RFC 3986, section 5.2.4).
bool IsDotSegment(std::string_view name) { return name == "." || name == ".."; }

}  // namespace

std::span<const std::string_view> ReservedDatasetNames() { return kReservedNames; }

std::string CheckDatasetName(const std::string& name) {
  if (name.empty() || name.size() > kMaxNameLength || !std::all_of(name.begin(), name.end(), IsNameCharacter) ||
      IsDotSegment(name)) {
    return fmt::format("must be 1 to {} letters, digits, '.', '_' or '-', as it becomes a part of URLs",
                       kMaxNameLength);
  }
  if (IsReserved(name)) {
    return fmt::format("is a URL of the server itself, as are {}; choose another name",
                       fmt::join(kReservedNames, ", "));
  }
  return {};
}

std::string SanitizeDatasetName(const std::string& text) {
  std::string name = text.substr(0, kMaxNameLength);
  std::replace_if(
      name.begin(), name.end(), [](char c) { return !IsNameCharacter(c); }, '-');
  if (name.empty() || IsDotSegment(name)) return "dem";
  if (IsReserved(name)) return name + "-dem";
  return name;
}

std::vector<ConfigError> FindDuplicateNames(const std::vector<DatasetConfig>& datasets) {
  std::vector<ConfigError> errors;
  std::map<std::string_view, std::size_t> first_of;
  for (std::size_t i = 0; i < datasets.size() && errors.size() < kMaxConfigErrors; ++i) {
    const auto [first, is_new] = first_of.emplace(datasets[i].name, i);
    if (is_new || datasets[i].name.empty()) continue;
    errors.push_back({fmt::format("/datasets/{}/name", i),
                      fmt::format("\"{}\" is the name of /datasets/{} too; every dataset needs its own",
                                  datasets[i].name, first->second)});
  }
  return errors;
}

}  // namespace terrace::config
