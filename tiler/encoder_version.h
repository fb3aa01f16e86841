// The version of the encoders, and the text of a dataset's version.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace terrace::tiler {

// Raise it with every change of the program that changes, for the same sources and options, the bytes of a tile,
// subtree, mesh or list of heights, or an error in a header. Clients and CDNs keep versioned replies for a year:
// without a new number they would mix old bytes with new ones. Changes of options and libraries need no new number:
// both are part of the version. A test records the bytes of some tiles for this number.
inline constexpr int kEncoderVersion = 11;

// Returns kEncoderVersion and the versions of the libraries that affect bytes: GDAL, PROJ, Draco and others.
std::string EncoderText();

// Returns the version as URLs and documents contain it: the first 12 of the 16 hexadecimal digits of a generation.
std::string VersionText(std::uint64_t generation);

// Whether `text` is the VersionText of `generation`.
bool IsVersionOf(std::string_view text, std::uint64_t generation);

}  // namespace terrace::tiler
