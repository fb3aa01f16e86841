// What Redis replied. The values lie in memory of hiredis.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string_view>

struct redisReply;

namespace terrace::redis {

// A view of a reply or of an element; the Reply must outlive it. Accessors that do not fit the kind return empty
// values, so that a reply of an unexpected form is handled like one without content.
class ReplyView {
 public:
  enum class Kind : std::uint8_t { kNil, kText, kInteger, kArray, kError };

  explicit ReplyView(const redisReply* reply) : reply_(reply) {}

  Kind kind() const;
  bool is_error() const { return kind() == Kind::kError; }
  bool is_nil() const { return kind() == Kind::kNil; }
  std::string_view text() const;               // of strings, status replies and errors; the bytes that were stored
  std::int64_t integer() const;                // of integers; else 0
  std::size_t size() const;                    // of arrays; else 0
  ReplyView operator[](std::size_t at) const;  // beyond the end: nil
  // The value after the element `name`, as in replies that list names and values; nil: none.
  ReplyView Field(std::string_view name) const;

 private:
  const redisReply* reply_;  // null: nil
};

class Reply : public ReplyView {
 public:
  // Takes ownership.
  explicit Reply(redisReply* reply) : ReplyView(reply), owned_(reply) {}

 private:
  struct Free {
    void operator()(redisReply* reply) const;
  };
  std::unique_ptr<redisReply, Free> owned_;
};

}  // namespace terrace::redis
