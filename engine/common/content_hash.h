// Hashes of contents: equal on every machine and for every copy.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string_view>
#include <type_traits>

struct XXH3_state_s;

namespace terrace::dem {

struct ContentHash {
  std::uint64_t high = 0, low = 0;

  friend bool operator==(const ContentHash&, const ContentHash&) = default;
};

// XXH3-128 of all that is added, in order.
class ContentHasher {
 public:
  ContentHasher();

  void AddBytes(const void* bytes, std::size_t size);
  // Adds the length as well, so that different divisions into texts have different hashes.
  void AddText(std::string_view text);
  template <typename T>
  void Add(T value) {
    static_assert(std::is_arithmetic_v<T>);
    AddBytes(&value, sizeof(value));
  }
  void Add(const ContentHash& hash) {
    Add(hash.high);
    Add(hash.low);
  }

  ContentHash Hash() const;

 private:
  struct Free {
    void operator()(XXH3_state_s* state) const;
  };
  std::unique_ptr<XXH3_state_s, Free> state_;
};

}  // namespace terrace::dem
