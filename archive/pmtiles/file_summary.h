// What is known of a finished PMTiles file.
#pragma once

#include <cstdint>
#include <string>

namespace terrace::archive {

// Of a unit, or of a whole archive in one file.
struct FileSummary {
  std::uint64_t tiles = 0;
  std::uint64_t bytes = 0;  // of the file
  std::string xxh3;         // XXH3-128 of the file, 32 hexadecimal digits

  friend bool operator==(const FileSummary&, const FileSummary&) = default;
};

}  // namespace terrace::archive
