#include "engine/gdal/remote_file.h"

#include <cpl_conv.h>
#include <cpl_vsi.h>
#include <cpl_vsi_error.h>

#include <mutex>
#include <string_view>
#include <utility>

#include "engine/gdal/gdal_runtime.h"
#include "engine/gdal/source_policy.h"

namespace terrace::dem {
namespace {

constexpr const char* kReadRemedy = "the endpoint, the credentials and their right to read";

// Whether a failed look-up says that there is no such file; else the store does not answer, or refuses. Stores that are
// not remote state no error.
bool IsAbsence(int error, std::string_view message) {
  return error == VSIE_None || error == VSIE_AWSObjectNotFound || message.find("response code: 404") != message.npos;
}

}  // namespace

struct RemoteFile::Impl {
  Impl(std::string p, VSILFILE* f, std::uint64_t s) : path(std::move(p)), file(f), size(s) {}
  ~Impl() { VSIFCloseL(file); }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  const std::string path;
  std::mutex mutex;
  VSILFILE* const file;  // used under mutex
  const std::uint64_t size;
};

bool IsGdalName(const std::string& path) { return path.starts_with("/vsi"); }

RemoteFile::RemoteFile(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
RemoteFile::~RemoteFile() = default;

Result<std::unique_ptr<RemoteFile>> RemoteFile::Open(const std::string& path) {
  if (!IsAllowedRemote(path)) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{} does not begin with an allowed prefix; add its bucket to allowed_prefixes, or give a folder",
                     path);
  }
  InitGdal();
  ForgetGdalError();
  // Else GDAL lists the folder, and takes what is put there later for absent.
  const CPLConfigOptionSetter no_list("GDAL_DISABLE_READDIR_ON_OPEN", "TRUE", /*bSetOnlyIfUndefined=*/false);
  VSICurlPartialClearCache(path.c_str());
  VSIStatBufL status{};
  if (VSIStatL(path.c_str(), &status) != 0) {
    // Only opening states the reason, and only without GDAL's cached results.
    VSICurlPartialClearCache(path.c_str());
    VSIErrorReset();
    if (VSILFILE* const there = VSIFOpenExL(path.c_str(), "rb", /*bSetError=*/TRUE)) VSIFCloseL(there);
    const std::string why = VSIGetLastErrorMsg();
    if (IsAbsence(VSIGetLastErrorNo(), why)) return MakeError(ErrorCode::kNotFound, "{} is not there", path);
    return MakeError(ErrorCode::kUnavailable, "{} cannot be looked up now: {}; check {}", path, why, kReadRemedy);
  }
  VSILFILE* const file = VSIFOpenL(path.c_str(), "rb");
  if (file == nullptr) {
    return MakeError(ErrorCode::kUnavailable, "{} cannot be opened now: {}; check {}", path, TakeGdalError(),
                     kReadRemedy);
  }
  return std::unique_ptr<RemoteFile>(
      new RemoteFile(std::make_unique<Impl>(path, file, static_cast<std::uint64_t>(status.st_size))));
}

std::uint64_t RemoteFile::size() const { return impl_->size; }

Result<std::string> RemoteFile::Read(std::uint64_t offset, std::size_t size) const {
  if (offset > impl_->size || size > impl_->size - offset) {
    return MakeError(
        ErrorCode::kUnavailable,
        "{} is truncated or damaged: it has {} bytes, and {} bytes from byte {} are needed; copy or bake it "
        "again",
        impl_->path, impl_->size, size, offset);
  }
  std::string bytes(size, '\0');
  const std::lock_guard lock(impl_->mutex);
  ForgetGdalError();
  const bool is_read =
      VSIFSeekL(impl_->file, offset, SEEK_SET) == 0 && VSIFReadL(bytes.data(), 1, size, impl_->file) == size;
  if (!is_read) {
    return MakeError(ErrorCode::kUnavailable, "{} cannot be read now: {}; check {}", impl_->path, TakeGdalError(),
                     kReadRemedy);
  }
  return bytes;
}

}  // namespace terrace::dem
