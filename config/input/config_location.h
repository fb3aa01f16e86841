// The location of a value in the configuration: the folder that its paths are relative to, and the list that its errors
// go to. For the modules of config/ only. Messages go into logs, and any value may be a token by mistake. Therefore a
// message quotes no value that is wrong, and no key that does not resemble a known one; it quotes names of datasets and
// of folders.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "config/common/working_directory.h"
#include "config/config.h"
#include "config/input/json_text.h"

namespace terrace::config {

class ConfigLocation {
 public:
  // `errors` must outlive this and every location made from it.
  ConfigLocation(std::filesystem::path directory, std::vector<ConfigError>& errors)
      : directory_(std::move(directory)), errors_(&errors) {}
  // The command line. Empty directory: the working directory has no name.
  static ConfigLocation InWorkingDirectory(std::filesystem::path directory, std::vector<ConfigError>& errors) {
    ConfigLocation place(std::move(directory), errors);
    place.is_command_line_ = true;
    return place;
  }

  ConfigLocation At(std::string_view key) const {
    ConfigLocation place = *this;
    place.path_ /= std::string(key);
    return place;
  }
  ConfigLocation At(std::size_t index) const { return At(std::to_string(index)); }

  void Fail(std::string message) const {
    if (!has_failed_often()) errors_->push_back({path_.to_string(), std::move(message)});
  }
  bool has_failed_often() const { return errors_->size() >= kMaxConfigErrors; }
  void Expected(std::string_view what) const { Fail("must be " + std::string(what)); }

  // The folder that relative paths are relative to.
  const std::filesystem::path& directory() const { return directory_; }
  // Makes a path absolute.
  std::string Resolve(const std::filesystem::path& path) const {
    // The system would read the path only up to the character, and so open another file.
    if (path.native().find('\0') != std::string::npos) Fail("has the character \\u0000, which no path has; remove it");
    if (!is_command_line_) return (directory_ / path).string();
    if (directory_.empty() && path.is_relative()) Fail(kNoWorkingDirectory);
    return FromWorkingDirectory(directory_, path);
  }

 private:
  std::filesystem::path directory_;
  Json::json_pointer path_;
  std::vector<ConfigError>* errors_;
  bool is_command_line_ = false;
};

}  // namespace terrace::config
