#include "tiler/store/seal.h"

#include <xxhash.h>

#include <cstring>
#include <utility>

namespace terrace::tiler {
namespace {

// The value's hash is seeded with the key's. Their lengths are part of the hashes.
std::uint64_t Checksum(std::string_view key, std::string_view value) {
  return XXH3_64bits_withSeed(value.data(), value.size(), XXH3_64bits(key.data(), key.size()));
}

}  // namespace

std::string Seal(std::string_view key, std::string value) {
  const std::uint64_t checksum = Checksum(key, value);
  value.append(reinterpret_cast<const char*>(&checksum), sizeof(checksum));
  return value;
}

std::optional<std::string_view> Unseal(std::string_view key, std::string_view sealed) {
  std::uint64_t checksum = 0;
  if (sealed.size() < sizeof(checksum)) return std::nullopt;
  const std::string_view value = sealed.substr(0, sealed.size() - sizeof(checksum));
  std::memcpy(&checksum, sealed.data() + value.size(), sizeof(checksum));
  if (checksum != Checksum(key, value)) return std::nullopt;
  return value;
}

}  // namespace terrace::tiler
