#include "fly/http/retry_after.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "engine/core/parse_number.h"

namespace terrace::fly {
namespace {

// "Sun, 06 Nov 1994 08:49:37 GMT".
std::optional<std::chrono::sys_seconds> ParseDate(std::string_view text) {
  constexpr std::string_view kMonths = "JanFebMarAprMayJunJulAugSepOctNovDec";
  if (text.size() != 29 || text.substr(3, 2) != ", " || text.substr(25) != " GMT") return std::nullopt;
  const auto number = [text](std::size_t at, std::size_t digits) {
    return ParseNumber<unsigned>(text.substr(at, digits));
  };
  const auto day = number(5, 2), year = number(12, 4), hour = number(17, 2), minute = number(20, 2),
             second = number(23, 2);
  const std::size_t month = kMonths.find(text.substr(8, 3));
  if (!day || !year || !hour || !minute || !second || month == std::string_view::npos || month % 3 != 0)
    return std::nullopt;
  const std::chrono::year_month_day date(std::chrono::year(static_cast<int>(*year)),
                                         std::chrono::month(static_cast<unsigned>(month / 3 + 1)),
                                         std::chrono::day(*day));
  if (!date.ok() || *hour > 23 || *minute > 59 || *second > 60) return std::nullopt;  // 60: a leap second
  return std::chrono::sys_days(date) + std::chrono::hours(*hour) + std::chrono::minutes(*minute) +
         std::chrono::seconds(*second);
}

}  // namespace

std::optional<double> RetryAfterSeconds(std::string_view retry_after, std::string_view date,
                                        std::chrono::system_clock::time_point now) {
  if (const auto seconds = ParseNumber<double>(retry_after)) {
    return *seconds >= 0 && std::isfinite(*seconds) ? seconds : std::nullopt;
  }
  const auto due = ParseDate(retry_after);
  if (!due) return std::nullopt;
  const auto sent = ParseDate(date);
  using Seconds = std::chrono::duration<double>;  // nanoseconds in 64 bits end in the year 2262
  const Seconds from = sent ? Seconds(sent->time_since_epoch()) : Seconds(now.time_since_epoch());
  return std::max(0.0, (Seconds(due->time_since_epoch()) - from).count());
}

}  // namespace terrace::fly
