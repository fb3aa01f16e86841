#include "server/http/access.h"

#include <openssl/evp.h>

#include <array>
#include <optional>

#include "engine/core/check.h"
#include "server/http/text.h"

namespace terrace::server {
namespace {

constexpr std::size_t kHashBytes = 32;

std::string Sha256(std::string_view text) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> hash{};
  unsigned size = 0;
  static const EVP_MD* const kAlgorithm = ::EVP_sha256();
  TERRACE_CHECK(::EVP_Digest(text.data(), text.size(), hash.data(), &size, kAlgorithm, nullptr) == 1);
  return {reinterpret_cast<const char*>(hash.data()), size};
}

std::optional<std::string> FromHex(std::string_view text) {
  if (text.size() != 2 * kHashBytes) return std::nullopt;
  std::string bytes;
  for (std::size_t i = 0; i < text.size(); i += 2) {
    const int high = HexDigit(text[i]), low = HexDigit(text[i + 1]);
    if (high < 0 || low < 0) return std::nullopt;
    bytes += static_cast<char>(high * 16 + low);
  }
  return bytes;
}

}  // namespace

Result<AccessPolicy> AccessPolicy::Make(const std::vector<TokenOptions>& tokens,
                                        const std::vector<std::string>& public_datasets) {
  AccessPolicy policy;
  for (const TokenOptions& options : tokens) {
    const std::optional<std::string> hash = options.sha256.empty() ? Sha256(options.token) : FromHex(options.sha256);
    if (!hash) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "token \"{}\": sha256 must be 64 hexadecimal digits, as sha256sum prints them", options.name);
    }
    Grant grant;
    grant.name = options.name;
    grant.sees_all = options.datasets.empty();
    grant.datasets = {options.datasets.begin(), options.datasets.end()};
    grant.datasets.insert(public_datasets.begin(), public_datasets.end());
    grant.requests_per_second = options.requests_per_second;
    if (!policy.grants_.emplace(*hash, std::make_shared<const Grant>(std::move(grant))).second) {
      return MakeError(ErrorCode::kInvalidArgument, "token \"{}\": another token is the same; make a new one",
                       options.name);
    }
  }
  Grant anonymous;
  anonymous.sees_all = tokens.empty();
  anonymous.datasets = {public_datasets.begin(), public_datasets.end()};
  policy.anonymous_ = std::make_shared<const Grant>(std::move(anonymous));
  return policy;
}

GrantPtr AccessPolicy::Find(std::string_view token) const {
  const auto found = grants_.find(Sha256(token));
  return found == grants_.end() ? nullptr : found->second;
}

}  // namespace terrace::server
