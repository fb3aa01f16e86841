// The path of the source tree, for tests that read its files.
#pragma once

#include <filesystem>

namespace terrace::test_support {

// The root of the source tree this program was built from, absolute. The path is compiled into one object alone, so
// that checkouts in other folders share all other objects of the compiler cache.
std::filesystem::path SourceDir();

}  // namespace terrace::test_support
