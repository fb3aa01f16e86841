#include "config/common/token_hash.h"

#include <openssl/evp.h>

#include <array>

#include "engine/core/check.h"

namespace terrace::config {

std::string TokenHash(std::string_view token) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> hash{};
  unsigned size = 0;
  static const EVP_MD* const kAlgorithm = ::EVP_sha256();
  TERRACE_CHECK(::EVP_Digest(token.data(), token.size(), hash.data(), &size, kAlgorithm, nullptr) == 1);
  std::string digits;
  digits.reserve(2 * std::size_t{size});
  for (unsigned i = 0; i < size; ++i) {
    digits += "0123456789abcdef"[hash[i] >> 4];
    digits += "0123456789abcdef"[hash[i] & 15];
  }
  return digits;
}

}  // namespace terrace::config
