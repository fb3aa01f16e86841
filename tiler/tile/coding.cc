#include "tiler/tile/coding.h"

#include "proto/compress.h"

namespace terrace::tiler {

std::string_view NameOf(Coding coding) {
  constexpr std::string_view kNames[] = {"", "gzip", "br", "zstd"};  // by value
  return kNames[static_cast<std::size_t>(coding)];
}

std::string Compress(std::string bytes, Coding coding, const std::stop_token& stop) {
  switch (coding) {
    case Coding::kIdentity:
      break;
    case Coding::kGzip:
      return proto::Gzip(bytes, stop);
    case Coding::kBrotli:
      return proto::Brotli(bytes, stop);
    case Coding::kZstd:
      return proto::Zstd(bytes, stop);
  }
  return bytes;
}

}  // namespace terrace::tiler
