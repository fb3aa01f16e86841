// Strong ETags: hashes of 128 bits, with quotes.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "tiler/tile/coding.h"

namespace terrace::tiler {

// The ETag of a body.
std::string StrongETag(std::string_view bytes);

// The ETag of a response whose body depends only on its `kind`, the dataset's generation and the text of the request. A
// conditional request can be answered without making the body. Equivalent requests with different texts have different
// ETags.
std::string RequestETag(std::string_view kind, std::string_view dataset, std::uint64_t generation,
                        std::string_view query, Coding coding);

}  // namespace terrace::tiler
