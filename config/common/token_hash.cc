#include "config/common/token_hash.h"

#include <fmt/format.h>
#include <openssl/evp.h>

#include <array>

#include "engine/core/check.h"

namespace terrace::config {

std::string TokenHash(std::string_view token) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> hash{};
  unsigned size = 0;
  static const EVP_MD* const kAlgorithm = ::EVP_sha256();
  TERRACE_CHECK(::EVP_Digest(token.data(), token.size(), hash.data(), &size, kAlgorithm, nullptr) == 1);
  return fmt::format("{:02x}", fmt::join(hash.begin(), hash.begin() + size, ""));
}

}  // namespace terrace::config
