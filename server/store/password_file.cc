#include "server/store/password_file.h"

#include <fstream>

namespace terrace::server {

Result<std::string> ReadPassword(const std::string& file) {
  std::ifstream stream(file);
  std::string password;
  std::getline(stream, password);
  if (password.ends_with('\r')) password.pop_back();
  if (!password.empty()) return password;
  return MakeError(ErrorCode::kUnavailable,
                   "{} cannot be read or is empty; it must have the password in its first line", file);
}

}  // namespace terrace::server
