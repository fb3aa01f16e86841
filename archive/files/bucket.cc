#include "archive/files/bucket.h"

#include <cpl_conv.h>
#include <cpl_string.h>
#include <cpl_vsi.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <utility>

#include "engine/core/errno_text.h"
#include "engine/gdal/gdal_runtime.h"
#include "engine/gdal/source_policy.h"

namespace terrace::archive {
namespace {

// GDAL writes to these by one request, or by an upload in parts that shows nothing until it is completed. To Azure and
// Swift it appends: readers would see unfinished objects.
constexpr std::array<std::string_view, 3> kStores = {"/vsis3/", "/vsigs/", "/vsioss/"};

tl::unexpected<Error> CannotPut(const std::string& object) {
  return MakeError(ErrorCode::kUnavailable,
                   "{} cannot be written: {}; check the bucket, the credentials and their right to write", object,
                   dem::TakeGdalError());
}

// An object that is being written. A failed write ends the upload: what was there under this name stays.
class OpenObject {
 public:
  static Result<OpenObject> Create(const std::string& object) {
    if (!dem::IsAllowedRemote(object)) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "{} does not begin with an allowed prefix; add its bucket to allowed_prefixes", object);
    }
    dem::InitGdal();
    dem::ForgetGdalError();
    OpenObject open(object, VSIFOpenExL(object.c_str(), "wb", /*bSetError=*/TRUE));
    if (open.file_ == nullptr) return CannotPut(object);
    return open;
  }

  OpenObject(OpenObject&& other) noexcept
      : object_(std::move(other.object_)), file_(std::exchange(other.file_, nullptr)) {}
  OpenObject& operator=(OpenObject&&) = delete;
  ~OpenObject() {
    if (file_ != nullptr) VSIFCloseL(file_);
  }

  Result<void> Write(std::string_view bytes) {
    if (bytes.empty() || VSIFWriteL(bytes.data(), 1, bytes.size(), file_) == bytes.size()) return {};
    return CannotPut(object_);
  }

  // Ends it if not all can be written: GDAL may put what it has, which is removed.
  void Abandon() {
    VSIFCloseL(std::exchange(file_, nullptr));
    VSIUnlink(object_.c_str());
  }

  // Small objects are sent here.
  Result<void> Close() {
    if (VSIFCloseL(std::exchange(file_, nullptr)) != 0) return CannotPut(object_);
    VSICurlPartialClearCache(object_.c_str());
    return {};
  }

 private:
  OpenObject(std::string object, VSILFILE* file) : object_(std::move(object)), file_(file) {}

  std::string object_;
  VSILFILE* file_;
};

}  // namespace

bool IsBucket(const std::string& place) {
  return std::ranges::any_of(kStores, [&](std::string_view store) { return place.starts_with(store); });
}

void LimitRequests() {
  constexpr std::array<std::pair<const char*, const char*>, 5> kLimits = {{{"GDAL_HTTP_CONNECTTIMEOUT", "10"},
                                                                           {"GDAL_HTTP_LOW_SPEED_TIME", "10"},
                                                                           {"GDAL_HTTP_LOW_SPEED_LIMIT", "1"},
                                                                           {"GDAL_HTTP_MAX_RETRY", "3"},
                                                                           {"GDAL_HTTP_RETRY_DELAY", "1"}}};
  dem::InitGdal();
  for (const auto& [name, value] : kLimits) CPLSetConfigOption(name, value);
}

Result<void> PutFile(int descriptor, const std::string& object) {
  Result<OpenObject> open = OpenObject::Create(object);
  if (!open) return tl::unexpected(std::move(open.error()));
  std::string piece(std::size_t{1} << 20, '\0');
  for (off_t at = 0;;) {
    const ssize_t read = ::pread(descriptor, piece.data(), piece.size(), at);
    if (read < 0 && errno == EINTR) continue;
    if (read < 0) {
      const int error = errno;
      open->Abandon();
      return MakeError(ErrorCode::kUnavailable, "a temporary file of {} cannot be read: {}", object, ErrorText(error));
    }
    if (read == 0) return open->Close();
    if (auto written = open->Write({piece.data(), static_cast<std::size_t>(read)}); !written) return written;
    at += read;
  }
}

Result<void> PutText(std::string_view text, const std::string& object) {
  Result<OpenObject> open = OpenObject::Create(object);
  if (!open) return tl::unexpected(std::move(open.error()));
  if (auto written = open->Write(text); !written) return written;
  return open->Close();
}

Result<std::vector<std::string>> NamesInBucket(const std::string& folder) {
  const auto fail = [&] {
    return MakeError(ErrorCode::kUnavailable, "{}: no object is listed; check the right to list the bucket", folder);
  };
  if (!dem::IsAllowedRemote(folder + "/x")) return fail();  // the folder itself may be the prefix
  dem::InitGdal();
  VSICurlPartialClearCache(folder.c_str());
  const CPLStringList names(VSIReadDir(folder.c_str()));
  VSICurlPartialClearCache(folder.c_str());  // else GDAL would take objects that are put later for absent
  std::vector<std::string> all;
  for (int i = 0; i < names.size(); ++i) {
    if (const std::string name = names[i]; name != "." && name != "..") all.push_back(name);
  }
  if (all.empty()) return fail();
  return all;
}

void RemoveObject(const std::string& object) {
  if (dem::IsAllowedRemote(object)) VSIUnlink(object.c_str());
}

}  // namespace terrace::archive
