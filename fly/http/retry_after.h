// The Retry-After header of replies.
#pragma once

#include <chrono>
#include <optional>
#include <string_view>

namespace terrace::fly {

// Seconds to wait, at least 0 (RFC 9110, 10.2.3): the header's number, or its date minus `date`, the reply's Date
// header; minus `now` if that is no date. Nothing if the header states neither. Dates are IMF-fixdates; the
// two obsolete forms, which no current server sends, are not read.
std::optional<double> RetryAfterSeconds(std::string_view retry_after, std::string_view date,
                                        std::chrono::system_clock::time_point now);

}  // namespace terrace::fly
