// Result<T>: a value, or an Error that says what went wrong, where, and what would be right.
//
// Foreseeable failures (input, disk, network, load) travel as Result. Mistakes of the program are TERRACE_CHECKs.
// Exceptions of libraries are caught in the file that calls the library.
#pragma once

#include <fmt/format.h>

#include <string>
#include <string_view>
#include <tl/expected.hpp>
#include <utility>

namespace terrace {

// What kind of failure it is; server/http/http_error.cc holds the one table from here to HTTP status codes.
enum class ErrorCode {
  kInvalidArgument,  // the caller asked for something that has no meaning
  kNotFound,         // it does not exist
  kUnavailable,      // a source or a resource does not answer now; asking again later may work
  kChanged,          // a source is not the one that was opened any more; whoever opens it anew gets an answer
  kOverloaded,       // a bounded queue is full
  kCancelled,        // nobody waits for the answer any more, or the time is up
  kInternal,         // a library failed in a way nobody foresaw
};

// A stable lower-case name for logs: "invalid_argument", "not_found", ...
std::string_view ToString(ErrorCode code);

struct Error {
  ErrorCode code = ErrorCode::kInternal;
  std::string message;  // one sentence for people: the thing, the place and the remedy; no trailing full stop
};

template <typename T>
using Result = tl::expected<T, Error>;

// return MakeError(ErrorCode::kNotFound, "{}: no such file", path);
template <typename... Args>
[[nodiscard]] tl::unexpected<Error> MakeError(ErrorCode code, fmt::format_string<Args...> format, Args&&... args) {
  return tl::unexpected<Error>(Error{code, fmt::format(format, std::forward<Args>(args)...)});
}

}  // namespace terrace
