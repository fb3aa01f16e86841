// Little-endian byte writer and reader. All binary formats of terrace are little-endian.
#pragma once

#include <bit>
#include <cstring>
#include <string>
#include <string_view>
#include <type_traits>

namespace terrace {

static_assert(std::endian::native == std::endian::little, "binary formats are written by memcpy");

class ByteWriter {
 public:
  void Reserve(std::size_t bytes) { out_.reserve(bytes); }

  template <typename T>
  void Put(T value) {
    static_assert(std::is_arithmetic_v<T>);
    char raw[sizeof(T)];
    std::memcpy(raw, &value, sizeof(T));
    out_.append(raw, sizeof(T));
  }
  void PutBytes(std::string_view bytes) { out_.append(bytes); }

  // Appends zeros up to the next multiple of `alignment`.
  void PadTo(std::size_t alignment) { out_.append((alignment - out_.size() % alignment) % alignment, '\0'); }

  std::size_t size() const { return out_.size(); }
  std::string Take() { return std::move(out_); }

 private:
  std::string out_;
};

// Reads what a ByteWriter wrote. After the first read past the end, ok() is false and every value is zero.
class ByteReader {
 public:
  explicit ByteReader(std::string_view bytes) : bytes_(bytes) {}

  template <typename T>
  T Get() {
    static_assert(std::is_arithmetic_v<T>);
    T value{};
    const std::string_view raw = GetBytes(sizeof(T));
    if (raw.size() == sizeof(T)) std::memcpy(&value, raw.data(), sizeof(T));
    return value;
  }
  // `count` bytes, or none when fewer are left.
  std::string_view GetBytes(std::size_t count) {
    if (!ok_ || bytes_.size() - at_ < count) {
      ok_ = false;
      return {};
    }
    at_ += count;
    return bytes_.substr(at_ - count, count);
  }
  bool ok() const { return ok_; }
  std::size_t remaining() const { return ok_ ? bytes_.size() - at_ : 0; }

 private:
  std::string_view bytes_;
  std::size_t at_ = 0;
  bool ok_ = true;
};

}  // namespace terrace
