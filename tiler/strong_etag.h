// ETags, the one place that makes them: strong, with their quotes, a hash of 128 bits.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "tiler/coding.h"

namespace terrace::tiler {

// Of bytes that the server made.
std::string StrongETag(std::string_view bytes);

// Of bytes that need not be made to know that a client has them: what `kind` of reply it is, the dataset's generation
// and the request's text decide about them. Different texts of one request have different ETags.
std::string RequestETag(std::string_view kind, std::string_view dataset, std::uint64_t generation,
                        std::string_view query, Coding coding);

}  // namespace terrace::tiler
