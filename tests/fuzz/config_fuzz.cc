// A configuration file of arbitrary bytes is either rejected with errors that have a location, or it is read, and
// writing and reading it again gives the same.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "config/file/parse.h"
#include "engine/core/check.h"
#include "tests/fuzz/fuzz_input.h"

namespace terrace::fuzz {
namespace {

// Globs over the folders of the machine would take long and test nothing.
bool LooksFarAround(const nlohmann::json& json) {
  if (json.is_string()) {
    const auto& text = json.get_ref<const std::string&>();
    return text.find_first_of("*?[") != std::string::npos && text.find_first_of("/.") != std::string::npos;
  }
  return json.is_structured() && std::any_of(json.begin(), json.end(), LooksFarAround);
}

std::filesystem::path Nowhere() { return "/nonexistent/folder"; }

void Run(std::string_view text) {
  if (LooksFarAround(nlohmann::json::parse(text, nullptr, /*allow_exceptions=*/false))) return;
  const config::ConfigResult parsed = config::ParseConfig(text, Nowhere());
  if (!parsed) {
    TERRACE_CHECK(!parsed.error().empty());
    for (const config::ConfigError& error : parsed.error()) {
      TERRACE_CHECK(!error.message.empty());
      TERRACE_CHECK(error.path.empty() || error.path.front() == '/');
    }
    return;
  }
  const std::string written = config::ToJson(*parsed);
  const config::ConfigResult again = config::ParseConfig(written, Nowhere());
  TERRACE_CHECK(again.has_value());
  TERRACE_CHECK(config::ToJson(*again) == written);
}

}  // namespace
}  // namespace terrace::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  terrace::fuzz::Run(std::string_view(reinterpret_cast<const char*>(data), size));
  return 0;
}
