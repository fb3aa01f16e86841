#include "server/store/password_file.h"

#include <algorithm>
#include <cstddef>
#include <fstream>

namespace terrace::server {

Result<std::string> ReadPassword(const std::string& file) {
  constexpr std::size_t kMaxBytes = 4096;
  std::ifstream stream(file);
  std::string password(kMaxBytes, '\0');
  stream.read(password.data(), kMaxBytes);
  password.resize(static_cast<std::size_t>(stream.gcount()));
  if (password.size() == kMaxBytes && password.find('\n') == std::string::npos) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: its first line has more than {} bytes, which is no password",
                     file, kMaxBytes - 1);
  }
  password.resize(std::min(password.find('\n'), password.size()));
  if (password.ends_with('\r')) password.pop_back();
  if (!password.empty()) return password;
  return MakeError(ErrorCode::kUnavailable,
                   "{} cannot be read or is empty; it must have the password in its first line", file);
}

}  // namespace terrace::server
