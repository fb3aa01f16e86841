// What may be told of a request's target, in a log and to caches that others share.
//
// A token may stand in a target in spellings that no reader knows: Token=, ;token=, token%3D, or in a path. So nobody
// looks for tokens here. Plain is a path of letters, digits and "-._~/", with parameters that the API has and values
// that they may have; all else may be a secret.
#pragma once

#include <string>
#include <string_view>

namespace terrace::server {

// Whether nothing of the target may be a secret: it is in origin form, and plain. Of a target whose `token` was taken
// out (TakeToken).
bool IsPlainTarget(std::string_view target);

// The plain part of the target: the path up to what is not plain ("..." stands for the rest), known parameters, and how
// many others there are: "/maui/heights?locations=1,2&+1". Of absolute targets without scheme and host. The value of
// `v`, which may be anything, is left out, and so is the whole of `token`. `is_known`: the path names something that
// the server has. Of others, which anything may stand in, a part between slashes that is as long as a token is "..." as
// well.
std::string ShownTarget(std::string_view target, bool is_known);

// The same of a Referer: scheme, host and the plain part of an unknown path; empty where it is no URL.
std::string ShownReferer(std::string_view referer);

// A token has so many characters at least.
inline constexpr std::size_t kMinTokenBytes = 16;

}  // namespace terrace::server
