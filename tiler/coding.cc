#include "tiler/coding.h"

#include "proto/compress.h"

namespace terrace::tiler {

std::string_view NameOf(Coding coding) {
  switch (coding) {
    case Coding::kIdentity:
      break;
    case Coding::kGzip:
      return "gzip";
    case Coding::kBrotli:
      return "br";
    case Coding::kZstd:
      return "zstd";
  }
  return "";
}

std::string Compress(std::string bytes, Coding coding, const std::stop_token& stop) {
  switch (coding) {
    case Coding::kIdentity:
      break;
    case Coding::kGzip:
      return proto::Gzip(bytes, proto::kGzipLevel, stop);
    case Coding::kBrotli:
      return proto::Brotli(bytes, proto::kBrotliQuality, stop);
    case Coding::kZstd:
      return proto::Zstd(bytes, proto::kZstdLevel, stop);
  }
  return bytes;
}

}  // namespace terrace::tiler
