// Result<T>: a value, or an Error that says what went wrong, where, and what would be right.
//
// Functions return foreseeable failures (input, disk, network, load) as Result. TERRACE_CHECK aborts on programming
// errors. Exceptions of third-party libraries are caught where they are called, and returned as Error. Functions that
// read, build or encode, and ElevationModel::RangeBound, may throw std::bad_alloc and ThrownError.
#pragma once

#include <fmt/core.h>

#include <exception>
#include <string>
#include <string_view>
#include <tl/expected.hpp>
#include <utility>

namespace terrace {

// The kind of a failure. server/http/http_error.cc maps it to HTTP status codes.
enum class ErrorCode {
  kInvalidArgument,  // the request is invalid
  kNotFound,         // it does not exist
  kUnavailable,      // a source or a resource does not respond now; a retry may succeed
  kChanged,          // a source file has changed since it was opened; reopening it may succeed
  kOverloaded,  // refused for now: a queue or store is full, memory is short, another process writes to the same folder
  kCancelled,   // stopped: nobody waits for the result, the deadline has passed, or the process ends; or
                // ElevationModel::OpenFromCache lacks statistics, which only Open computes
  kInternal,    // a library, or terrace itself, failed unexpectedly
};

// A stable lower-case name for logs: "invalid_argument", "not_found", ...
std::string_view ToString(ErrorCode code);

struct Error {
  ErrorCode code = ErrorCode::kInternal;
  // For people: the thing, the place and the remedy. One sentence without a full stop at its end; of edits, a line for
  // each fault.
  std::string message;
};

// An Error as an exception: statistics of a source can neither be read from the cache folder nor be computed again.
class ThrownError : public std::exception {
 public:
  explicit ThrownError(Error error) : error_(std::move(error)) {}
  const Error& error() const { return error_; }
  const char* what() const noexcept override { return error_.message.c_str(); }

 private:
  Error error_;
};

template <typename T>
using Result = tl::expected<T, Error>;

// return MakeError(ErrorCode::kNotFound, "{}: no such file", path);
template <typename... Args>
[[nodiscard]] tl::unexpected<Error> MakeError(ErrorCode code, fmt::format_string<Args...> format, Args&&... args) {
  return tl::unexpected<Error>(Error{code, fmt::format(format, std::forward<Args>(args)...)});
}

}  // namespace terrace
