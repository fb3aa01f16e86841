// What is wrong with a JSON document, for messages.
#pragma once

#include <cstddef>
#include <exception>
#include <string>
#include <string_view>

namespace terrace::fly {

// The message without the JSON library's code: "[json.exception.out_of_range.403] key 'x' not found" becomes
// "key 'x' not found".
inline std::string JsonReason(const std::exception& error) {
  const std::string_view message = error.what();
  const std::size_t end = message.starts_with("[json.") ? message.find("] ") : std::string_view::npos;
  return std::string(end == std::string_view::npos ? message : message.substr(end + 2));
}

}  // namespace terrace::fly
