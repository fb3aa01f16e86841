#include "server/cli/serve/check_start.h"

#include <cstdio>
#include <filesystem>
#include <system_error>
#include <vector>

#include "engine/gdal/source_policy.h"
#include "server/cli/common/check_folder.h"
#include "server/cli/common/command.h"
#include "server/cli/common/source_files.h"
#include "server/server.h"
#include "server/store/shared_cache.h"

namespace terrace::cli {

int CheckStart(const config::Config& config, const config::Config& served,
               const Result<server::DescriptorBudget>& descriptors, bool tries_address) {
  std::vector<Error> errors = server::Server::CheckStartFiles(served);
  const auto note = [&](const Result<void>& result) {
    if (!result) errors.push_back(result.error());
  };
  std::error_code ignored;
  if (const auto& viewer = config.viewer.directory;
      !viewer.empty() && !std::filesystem::is_directory(viewer, ignored)) {
    note(MakeError(ErrorCode::kNotFound, "viewer {}: is no folder; name one with a web page, or true or false",
                   viewer.string()));
  }
  // An existing cache is opened even if its disk is read-only now: the server can start without it.
  const std::filesystem::path cache = config.disk_cache.directory;
  if (!cache.empty() && !std::filesystem::exists(cache / "lock", ignored)) {
    if (const auto folder = CheckFolder(cache); !folder) {
      note(MakeError(folder.error().code, "disk_cache: {}", folder.error().message));
    }
  }
  bool is_wrong_text = false;
  if (!config.shared_cache.url.empty()) {
    const Result<void> shared = server::CheckSharedCache(config.shared_cache);
    is_wrong_text = !shared && shared.error().code == ErrorCode::kInvalidArgument;
    note(shared);
  }
  if (!descriptors) errors.push_back(descriptors.error());
  if (tries_address) note(server::Server::CheckAddress(served));
  const Result<void> policy =
      dem::SetSourcePolicy({config.data_roots, config.allowed_prefixes, config.allowed_drivers});
  note(policy);
  for (const config::DatasetConfig& dataset : config.datasets) {
    const Result<void> readable = CheckReadable(dataset);
    note(readable && policy ? CheckSourcePolicy(dataset) : readable);
    if (readable) note(CheckEditFiles(dataset));
  }
  for (const Error& error : errors) std::fprintf(stderr, "terrace: %s\n", error.message.c_str());
  if (!policy || is_wrong_text) return kExitUsage;
  return errors.empty() ? kExitOk : kExitFailure;
}

}  // namespace terrace::cli
