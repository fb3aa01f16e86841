// write_option_docs SOURCE_DIR: writes config/config.schema.json and the tables of docs/configuration.md.
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "config/options/option_docs.h"

namespace {

bool Write(const std::filesystem::path& file, const std::string& text) {
  std::ofstream stream(file, std::ios::binary);
  stream << text << std::flush;
  if (!stream) std::fprintf(stderr, "%s: cannot be written\n", file.c_str());
  return static_cast<bool>(stream);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fputs("usage: write_option_docs SOURCE_DIR\n", stderr);
    return 2;
  }
  const std::filesystem::path root = argv[1], manual = root / "docs/configuration.md";
  std::ifstream stream(manual, std::ios::binary);
  const terrace::Result<std::string> updated =
      terrace::config::UpdateManual(std::string{std::istreambuf_iterator<char>(stream), {}});
  if (!updated) {
    std::fprintf(stderr, "%s: %s\n", manual.c_str(), updated.error().message.c_str());
    return 1;
  }
  const bool is_written = Write(manual, *updated);
  return Write(root / "config/config.schema.json", terrace::config::SchemaText()) && is_written ? 0 : 1;
}
