// What of the program decides the bytes of a tile, and how a dataset's version is written.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace terrace::tiler {

// Raise it with every change of the program after which the same sources and options give other bytes, or another error
// in a header, of any tile, subtree, mesh or list of heights. Clients and CDNs keep what has a version for a year: with
// the old number they would mix old bytes with new ones. Changes of libraries count by themselves (EncoderText), and so
// do options. A test knows the bytes of some tiles with this number.
inline constexpr int kEncoderVersion = 1;

// The encoder version, and the versions of the libraries that decide bytes: GDAL, PROJ, Draco and the like.
std::string EncoderText();

// As it stands in URLs and documents: the first 12 of the 16 hexadecimal digits of a dataset's generation.
std::string VersionText(std::uint64_t generation);

// Whether a text is the VersionText of that generation.
bool IsVersionOf(std::string_view text, std::uint64_t generation);

}  // namespace terrace::tiler
