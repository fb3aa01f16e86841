#include "config/parse.h"

#include <cerrno>
#include <fstream>
#include <iterator>
#include <system_error>

#include "config/json_text.h"
#include "config/option_table.h"
#include "config/source_paths.h"

namespace terrace::config {
namespace {

// Editors find the schema through this key; it is no option.
constexpr const char* kSchemaKey = "$schema";

tl::unexpected<std::vector<ConfigError>> Unreadable(const std::string& reason) {
  return tl::unexpected(std::vector<ConfigError>{{"", reason}});
}

}  // namespace

ConfigResult ParseConfig(std::string_view text, const std::filesystem::path& directory) {
  std::vector<ConfigError> errors;
  Json root = ParseJsonText(text, errors);
  if (root.is_discarded()) return tl::unexpected(std::move(errors));
  if (root.is_object()) root.erase(kSchemaKey);
  Config config;
  ReadObject(root, Place(directory, "", errors), ServerOptionTable(), config);
  const std::vector<ConfigError> duplicates = FindDuplicateNames(config.datasets);
  errors.insert(errors.end(), duplicates.begin(), duplicates.end());
  if (!errors.empty()) return tl::unexpected(std::move(errors));
  return config;
}

ConfigResult LoadConfig(const std::filesystem::path& file) {
  std::error_code ignored;
  if (std::filesystem::is_directory(file, ignored)) return Unreadable("is a folder; name a JSON file in it");
  std::ifstream stream(file, std::ios::binary);
  if (!stream) return Unreadable("cannot be read: " + std::generic_category().message(errno));
  const std::string text{std::istreambuf_iterator<char>(stream), {}};
  if (stream.bad()) return Unreadable("cannot be read to its end");
  std::error_code unnamed;
  const std::filesystem::path whole = std::filesystem::absolute(file, unnamed);
  if (unnamed) return Unreadable("is relative to the working directory, which cannot be named: " + unnamed.message());
  return ParseConfig(text, whole.parent_path());
}

Result<SourceConfig> SourceAt(const std::string& path) {
  std::error_code ignored;
  return std::filesystem::is_directory(path, ignored) ? ExpandSource(path, {}) : SourceConfig(path);
}

std::string ToJson(const Config& config) {
  return WriteObject(config, ServerOptionTable()).dump(2, ' ', /*ensure_ascii=*/false, Json::error_handler_t::replace) +
         '\n';
}

}  // namespace terrace::config
