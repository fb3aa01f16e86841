#include "server/query/list_parameters.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "server/http/text.h"
#include "server/query/drawn_parameters.h"

namespace terrace::server {
namespace {

constexpr std::size_t kMaxNameBytes = 16;  // no name is as long

std::string_view Known(std::span<const std::string_view> names, std::string_view name) {
  const auto known = std::ranges::find(names, name);
  return known == names.end() ? std::string_view() : *known;
}

}  // namespace

tl::unexpected<Error> ListParameters::Unknown() const {
  return MakeError(ErrorCode::kInvalidArgument, "unknown parameter; known are {}, {}, and with surface=served {}",
                   fmt::join(names_.lists, ", "), fmt::join(names_.texts, ", "), fmt::join(kDrawnNames, ", "));
}

Result<void> ListParameters::AddToName(std::string_view part) {
  if (name_.size() + part.size() > kMaxNameBytes) return Unknown();
  name_ += part;
  return {};
}

Result<void> ListParameters::EndName() {
  const std::string name = std::exchange(name_, {});
  current_ = {};
  if (name == "v") return {};
  if (const std::string_view list = Known(names_.lists, name); !list.empty()) {
    if (!list_.empty() && list != list_) {
      return MakeError(ErrorCode::kInvalidArgument, "either {} is needed, not both", fmt::join(names_.lists, " or "));
    }
    if (!list_.empty()) return MakeError(ErrorCode::kInvalidArgument, "{} is given more than once", list);
    current_ = list_ = list;
    return {};
  }
  current_ = Known(names_.texts, name);
  if (current_.empty()) current_ = Known(kDrawnNames, name);
  if (current_.empty()) return Unknown();
  if (texts_.contains(current_)) return MakeError(ErrorCode::kInvalidArgument, "{} is given more than once", current_);
  return {};
}

Result<void> ListParameters::AddToValue(std::string_view part) {
  if (current_.empty()) return {};
  while (is_in_list()) {
    const std::size_t bar = part.find('|');
    if (bar == std::string_view::npos) break;
    if (const Result<void> added = AddToItem(part.substr(0, bar)); !added) return added;
    if (const Result<void> ended = EndItem(); !ended) return ended;
    part.remove_prefix(bar + 1);
  }
  return AddToItem(part);
}

Result<void> ListParameters::EndValue() {
  if (current_.empty()) return {};
  if (!is_in_list()) {
    texts_.emplace(current_, std::exchange(item_, {}));
    return {};
  }
  if (items_ == 0 && Trim(item_, " ").empty()) {
    return MakeError(ErrorCode::kInvalidArgument, "{} is empty", list_);
  }
  return EndItem();
}

Result<void> ListParameters::AddToItem(std::string_view part) {
  if (item_.size() + part.size() > kMaxItemBytes) {
    const std::string which = is_in_list() ? fmt::format(": item {}", items_ + 1) : "";
    return MakeError(ErrorCode::kInvalidArgument, "{}{} is longer than {} bytes", current_, which, kMaxItemBytes);
  }
  item_ += part;
  return {};
}

Result<void> ListParameters::EndItem() {
  const Result<void> added = add_item_(list_, ++items_, item_);
  item_.clear();
  return added;
}

}  // namespace terrace::server
