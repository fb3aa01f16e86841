// URLs as far as a client of tiles needs them: http and https, absolute or relative.
#pragma once

#include <string>
#include <string_view>

#include "engine/core/result.h"

namespace terrace::fly {

struct Origin {
  bool is_tls = false;
  std::string host;  // without brackets, for IPv6 too
  std::string port;  // "1" to "65535"

  friend auto operator<=>(const Origin&, const Origin&) = default;
};

struct Url {
  Origin origin;
  std::string target;  // "/path?query"; no fragment

  std::string Text() const;
  // For people and reports: without the values of the query that are long enough to be a secret.
  std::string PublicText() const;
};

// kInvalidArgument if the text is not an http or https URL; the message begins with it, as PublicText
// shows it.
Result<Url> ParseUrl(std::string_view text);

// RFC 3986, section 5, for a `reference` with a path. Resolves "./" and "../" at its beginning only.
Result<Url> Resolve(const Url& base, std::string_view reference);

// The same, and parameters of the base's query whose names the reference's query lacks are added, as cesium-native does
// for tiles. A reference to another origin gets none: a parameter may be a secret.
Result<Url> ResolveWithQuery(const Url& base, std::string_view reference);

}  // namespace terrace::fly
