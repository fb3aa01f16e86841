#include "server/tiles/coding.h"

#include "proto/compress.h"

namespace terrace::server {

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

std::string Compress(std::string bytes, Coding coding) {
  switch (coding) {
    case Coding::kIdentity:
      break;
    case Coding::kGzip:
      return proto::Gzip(bytes);
    case Coding::kBrotli:
      return proto::Brotli(bytes);
    case Coding::kZstd:
      return proto::Zstd(bytes);
  }
  return bytes;
}

}  // namespace terrace::server
