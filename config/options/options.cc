#include "config/options/options.h"

#include <fmt/format.h>

#include <algorithm>

#include "config/options/option_table.h"
#include "engine/core/check.h"

namespace terrace::config {
namespace {

template <typename Target>
std::vector<OptionInfo> Infos(const std::vector<Option<Target>>& table) {
  std::vector<OptionInfo> infos;
  for (const Option<Target>& option : table) {
    infos.push_back({option.key, option.value, option.help, option.codec.from_text != nullptr, DefaultOf(option),
                     option.other_words});
  }
  return infos;
}

template <typename Target>
void SetFromText(const std::vector<Option<Target>>& table, std::string_view key, const std::string& text,
                 const std::filesystem::path& directory, Target& target, std::vector<ConfigError>& errors) {
  const auto option =
      std::find_if(table.begin(), table.end(), [&](const Option<Target>& candidate) { return candidate.key == key; });
  TERRACE_CHECK(option != table.end() && option->codec.from_text != nullptr);
  std::vector<ConfigError> found;
  option->codec.read(option->codec.from_text(text), ConfigLocation::InWorkingDirectory(directory, found), target);
  for (const ConfigError& error : found) errors.push_back({FlagOf(key), error.message});
}

template <typename Target>
std::vector<std::string> ChangedOptions(const std::vector<Option<Target>>& table, const Target& a, const Target& b) {
  std::vector<std::string> keys;
  for (const Option<Target>& option : table) {
    if (option.codec.write(a) != option.codec.write(b)) keys.emplace_back(option.key);
  }
  return keys;
}

template <typename Target>
void FindUnused(const std::vector<Option<Target>>& table, const std::string& above, const Target& target,
                std::vector<ConfigError>& unused) {
  for (const Option<Target>& option : table) {
    if (option.is_used == nullptr || option.is_used(target)) continue;
    if (option.codec.write(target) == option.codec.write(Target{})) continue;
    unused.push_back({above + std::string(option.key),
                      fmt::format("has no effect, because it needs {}; set that, or remove this", option.needs)});
  }
}

}  // namespace

std::string FlagOf(std::string_view key) {
  std::string flag = "--" + std::string(key);
  std::replace(flag.begin(), flag.end(), '_', '-');
  return flag;
}

std::string OptionInfo::Flag() const { return FlagOf(key); }

std::vector<OptionInfo> ServerOptionInfos() { return Infos(ServerOptionTable()); }
std::vector<OptionInfo> DatasetOptionInfos() { return Infos(DatasetOptionTable()); }

bool NeedsRestart(std::string_view key) {
  const auto& table = ServerOptionTable();
  return std::none_of(table.begin(), table.end(),
                      [&](const Option<Config>& option) { return option.key == key && option.is_live; });
}

std::vector<std::string> ChangedServerOptions(const Config& a, const Config& b) {
  return ChangedOptions(ServerOptionTable(), a, b);
}

std::vector<std::string> ChangedDatasetOptions(const DatasetConfig& a, const DatasetConfig& b) {
  return ChangedOptions(DatasetOptionTable(), a, b);
}

std::vector<ConfigError> FindUnusedOptions(const Config& config) {
  std::vector<ConfigError> unused;
  FindUnused(ServerOptionTable(), "", config, unused);
  FindUnused(SharedCacheOptionTable(), "shared_cache.", config.shared_cache, unused);
  return unused;
}

void SetServerOption(std::string_view key, const std::string& text, const std::filesystem::path& directory,
                     Config& config, std::vector<ConfigError>& errors) {
  SetFromText(ServerOptionTable(), key, text, directory, config, errors);
}

void SetDatasetOption(std::string_view key, const std::string& text, const std::filesystem::path& directory,
                      DatasetConfig& dataset, std::vector<ConfigError>& errors) {
  SetFromText(DatasetOptionTable(), key, text, directory, dataset, errors);
}

}  // namespace terrace::config
