#include "archive/files/zip_writer.h"

#include <openssl/evp.h>

#include <algorithm>
#include <array>
#include <limits>
#include <optional>
#include <tuple>
#include <utility>

#include "engine/core/bytes.h"
#include "engine/core/check.h"
#include "proto/compress.h"

namespace terrace::archive {
namespace {

constexpr std::string_view kIndexName = "@3dtilesIndex1@";
constexpr std::uint32_t kMax32 = std::numeric_limits<std::uint32_t>::max();
constexpr std::uint16_t kMax16 = std::numeric_limits<std::uint16_t>::max();
constexpr std::uint16_t kStored = 0, kDeflated = 8;
constexpr std::uint16_t kVersion = 20, kVersion64 = 45;
constexpr std::uint16_t kUnix = 3 << 8;
constexpr std::uint16_t kNoTime = 0, kFirstDay = 0x21;  // 1980-01-01
constexpr std::uint32_t kRegularFile = 0100644U << 16;

using Md5 = std::array<unsigned char, EVP_MAX_MD_SIZE>;

// The index finds entries by MD5, which protects nothing. So it is also right where OpenSSL allows only algorithms of
// FIPS 140 by default. Null: there is none.
const EVP_MD* Md5Algorithm() {
  static const EVP_MD* const kAlgorithm = ::EVP_MD_fetch(nullptr, "MD5", "-fips");
  return kAlgorithm;
}

Md5 Md5Of(std::string_view text) {
  Md5 hash{};
  unsigned size = 0;
  TERRACE_CHECK(::EVP_Digest(text.data(), text.size(), hash.data(), &size, Md5Algorithm(), nullptr) == 1);
  return hash;
}

}  // namespace

Result<ZipWriter> ZipWriter::Create(const std::string& path, std::uint64_t start) {
  if (Md5Algorithm() == nullptr) {
    return MakeError(ErrorCode::kUnavailable,
                     "{} cannot be written: the index of a 3TZ file needs MD5, which the OpenSSL of this machine does "
                     "not have; activate its default provider, or use --form folder",
                     path);
  }
  Result<OutputFile> out = OutputFile::Create(path);
  if (!out) return tl::unexpected(std::move(out.error()));
  if (start > 0) {
    if (Result<void> skipped = out->Skip(start); !skipped) return tl::unexpected(std::move(skipped.error()));
  }
  Result<SpoolFile> directory = SpoolFile::Create(path);
  if (!directory) return tl::unexpected(std::move(directory.error()));
  return ZipWriter(*std::move(out), *std::move(directory));
}

Result<void> ZipWriter::Add(std::string_view name, std::string_view bytes) {
  TERRACE_CHECK(!bytes.empty() && bytes.size() < kMax32);
  return Put(name, {kStored, proto::Crc32(bytes), static_cast<std::uint32_t>(bytes.size()), bytes});
}

Result<void> ZipWriter::AddGzip(std::string_view name, std::string_view gzip) {
  const std::optional<proto::GzipMember> member = proto::SplitGzip(gzip);
  if (!member || gzip.size() >= kMax32) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: is not compressed by gzip", name);
  }
  return Put(name, {kDeflated, member->crc32, member->size, member->deflated});
}

Result<void> ZipWriter::Put(std::string_view name, const Content& content) {
  const std::uint64_t offset = out_.size();
  const bool is_far = offset >= kMax32;
  const std::uint16_t version = is_far ? kVersion64 : kVersion;
  // What the two headers of an entry have in common.
  const auto put_common = [&](ByteWriter& to, std::uint16_t extra_bytes) {
    to.Put(version);
    to.Put<std::uint16_t>(0);
    to.Put(content.method);
    to.Put(kNoTime);
    to.Put(kFirstDay);
    to.Put(content.crc32);
    to.Put(static_cast<std::uint32_t>(content.bytes.size()));
    to.Put(content.size);
    to.Put(static_cast<std::uint16_t>(name.size()));
    to.Put(extra_bytes);
  };
  ByteWriter local;
  local.Put<std::uint32_t>(0x04034b50);
  put_common(local, 0);
  local.PutBytes(name);
  const std::string head = local.Take();
  for (const std::string_view part : {std::string_view(head), content.bytes}) {
    if (Result<void> written = out_.Write(part); !written) return written;
  }

  constexpr std::uint16_t kOffset64Bytes = 12;
  ByteWriter central;
  central.Put<std::uint32_t>(0x02014b50);
  central.Put(static_cast<std::uint16_t>(kUnix | kVersion64));
  put_common(central, is_far ? kOffset64Bytes : 0);
  central.Put<std::uint16_t>(0);  // comment
  central.Put<std::uint16_t>(0);  // disk
  central.Put<std::uint16_t>(0);  // internal attributes
  central.Put(kRegularFile);
  central.Put(is_far ? kMax32 : static_cast<std::uint32_t>(offset));
  central.PutBytes(name);
  if (is_far) {
    central.Put<std::uint16_t>(1);
    central.Put<std::uint16_t>(8);
    central.Put(offset);
  }
  const std::string record = central.Take();
  if (const auto spooled = directory_.Append(record); !spooled) return tl::unexpected(spooled.error());
  directory_bytes_ += record.size();
  ++entries_;

  const Md5 hash = Md5Of(name);
  ByteReader numbers({reinterpret_cast<const char*>(hash.data()), 16});
  Indexed indexed;
  indexed.low = numbers.Get<std::uint64_t>();
  indexed.high = numbers.Get<std::uint64_t>();
  indexed.offset = offset;
  index_.push_back(indexed);
  return {};
}

Result<void> ZipWriter::Finish() {
  const auto hash_of = [](const Indexed& entry) { return std::tie(entry.low, entry.high); };
  std::ranges::sort(index_, {}, hash_of);
  if (std::ranges::adjacent_find(index_, {}, hash_of) != index_.end()) {
    return MakeError(ErrorCode::kInvalidArgument, "an entry of a 3TZ file was added twice");
  }
  constexpr std::size_t kIndexedBytes = 24;
  if (index_.size() >= kMax32 / kIndexedBytes) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "a 3TZ file can have {} entries, not {}; limit --levels or --bbox, or use --form folder",
                     kMax32 / kIndexedBytes, index_.size());
  }
  ByteWriter index;
  index.Reserve(index_.size() * kIndexedBytes);
  for (const Indexed& entry : index_) {
    for (const std::uint64_t number : {entry.low, entry.high, entry.offset}) index.Put(number);
  }
  if (Result<void> added = Add(kIndexName, index.Take()); !added) return added;

  const std::uint64_t start = out_.size();
  constexpr std::uint64_t kPiece = std::uint64_t{1} << 20;
  for (std::uint64_t at = 0; at < directory_bytes_; at += kPiece) {
    const auto piece = directory_.Read(at, std::min(kPiece, directory_bytes_ - at));
    if (!piece) return tl::unexpected(piece.error());
    if (Result<void> written = out_.Write(*piece); !written) return written;
  }
  const std::uint64_t end = out_.size();
  ByteWriter tail;
  if (entries_ >= kMax16 || start >= kMax32 || directory_bytes_ >= kMax32) {
    tail.Put<std::uint32_t>(0x06064b50);
    tail.Put<std::uint64_t>(44);  // bytes of this record that follow
    tail.Put(static_cast<std::uint16_t>(kUnix | kVersion64));
    tail.Put(kVersion64);
    tail.Put<std::uint32_t>(0);  // disks
    tail.Put<std::uint32_t>(0);
    for (const std::uint64_t number : {entries_, entries_, directory_bytes_, start}) tail.Put(number);
    tail.Put<std::uint32_t>(0x07064b50);
    tail.Put<std::uint32_t>(0);
    tail.Put(end);
    tail.Put<std::uint32_t>(1);
  }
  const auto entries = static_cast<std::uint16_t>(std::min<std::uint64_t>(entries_, kMax16));
  tail.Put<std::uint32_t>(0x06054b50);
  tail.Put<std::uint32_t>(0);  // disks
  tail.Put(entries);
  tail.Put(entries);
  tail.Put(static_cast<std::uint32_t>(std::min<std::uint64_t>(directory_bytes_, kMax32)));
  tail.Put(static_cast<std::uint32_t>(std::min<std::uint64_t>(start, kMax32)));
  tail.Put<std::uint16_t>(0);  // comment
  if (Result<void> written = out_.Write(tail.Take()); !written) return written;
  return out_.Finish();
}

}  // namespace terrace::archive
