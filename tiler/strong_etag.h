// Strong ETags: hashes of 128 bits, with quotes.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "tiler/coding.h"

namespace terrace::tiler {

// Of a body.
std::string StrongETag(std::string_view bytes);

// Of a response whose body is determined by its `kind`, the dataset's generation and the text of the request, so that a
// conditional request needs no body. Different texts of one request have different ETags.
std::string RequestETag(std::string_view kind, std::string_view dataset, std::uint64_t generation,
                        std::string_view query, Coding coding);

}  // namespace terrace::tiler
