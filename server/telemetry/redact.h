// Removes possible secrets from request targets, for logs and for shared caches.
// A token may appear in a target in spellings that no parser recognizes: Token=, ;token=, token%3D, or in a path.
// Therefore this code does not search for tokens. It defines what is plain: a path of letters, digits and "-._~/", and
// known parameters with valid values. Everything else may be a secret.
#pragma once

#include <string>
#include <string_view>

namespace terrace::server {

// Whether no part of the target can be a secret: it is in origin form and plain. Precondition: TakeToken has removed
// `token`.
bool IsPlainTarget(std::string_view target);

// Returns the plain part of the target: the path up to the first part that is not plain ("..." replaces the rest),
// known parameters, and the number of other parameters: "/maui/heights?locations=1,2&+1". Removes scheme and host of
// absolute targets, the value of `v`, which may be anything, and `token`. `is_known`: the path is a URL of the server.
// In other paths, "..." also replaces segments that are long enough to be a token.
std::string RedactTarget(std::string_view target, bool is_known);

// The same for a Referer: scheme, host and the plain part of an unknown path; empty if it is not a URL.
std::string RedactReferer(std::string_view referer);

}  // namespace terrace::server
