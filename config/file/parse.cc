#include "config/file/parse.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <system_error>

#include "config/input/json_text.h"
#include "config/input/source_paths.h"
#include "config/options/option_table.h"
#include "engine/core/errno_text.h"

namespace terrace::config {
namespace {

tl::unexpected<std::vector<ConfigError>> Unreadable(const std::string& reason) {
  return tl::unexpected(std::vector<ConfigError>{{"", reason}});
}

std::string TooLarge(const std::filesystem::path& file) {
  return fmt::format("{} is larger than the {} MiB that a configuration may have; put the right file there",
                     file.string(), kMaxConfigBytes >> 20);
}

// Reads a file, or a pipe to its end. The error says why that failed. Files that are too large are not read.
tl::expected<std::string, std::string> ReadText(int descriptor, const std::filesystem::path& file) {
  struct stat status {};
  if (::fstat(descriptor, &status) == 0) {
    if (S_ISDIR(status.st_mode)) return tl::unexpected(std::string("is a folder; name a JSON file in it"));
    if (S_ISREG(status.st_mode) && status.st_size > static_cast<off_t>(kMaxConfigBytes)) {
      return tl::unexpected(TooLarge(file));
    }
  }
  std::string text;
  for (std::size_t size = 0;;) {
    text.resize(std::min(std::max<std::size_t>(2 * size, 4096), kMaxConfigBytes + 1));
    const ssize_t got = ::read(descriptor, text.data() + size, text.size() - size);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return tl::unexpected("cannot be read: " + ErrorText());
    size += static_cast<std::size_t>(got);
    if (size > kMaxConfigBytes) return tl::unexpected(TooLarge(file));
    if (got > 0) continue;
    text.resize(size);
    return text;
  }
}

}  // namespace

ConfigResult ParseConfig(std::string_view text, const std::filesystem::path& directory) {
  std::vector<ConfigError> errors;
  Json root = ParseJsonText(text, errors);
  if (root.is_discarded()) return tl::unexpected(std::move(errors));
  if (root.is_object()) root.erase(kSchemaKey);
  Config config;
  ReadObject(root, ConfigLocation(directory, errors), ServerOptionTable(), config);
  const std::vector<ConfigError> duplicates = FindDuplicateNames(config.datasets);
  errors.insert(errors.end(), duplicates.begin(), duplicates.end());
  if (!errors.empty()) return tl::unexpected(std::move(errors));
  return config;
}

ConfigResult LoadConfig(const std::filesystem::path& file) {
  const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) return Unreadable("cannot be read: " + ErrorText());
  const tl::expected<std::string, std::string> text = ReadText(descriptor, file);
  ::close(descriptor);
  if (!text) return Unreadable(text.error());
  std::error_code unnamed;
  const std::filesystem::path whole = std::filesystem::absolute(file, unnamed);
  if (unnamed) return Unreadable("is relative to the working directory, which cannot be named: " + unnamed.message());
  return ParseConfig(*text, whole.parent_path());
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
