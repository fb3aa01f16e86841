// Reads edits from GeoJSON files (RFC 7946; docs/edits.md).
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "engine/common/dem_types.h"
#include "engine/edits/edit.h"

namespace terrace::dem {

// What is wrong with a feature or a file.
struct EditFault {
  std::string file;
  std::optional<std::size_t> feature = {};  // its index; nothing: the file itself
  std::optional<GeoPosition> place = {};
  std::string message;  // what is wrong, and what would be right

  // "edits.geojson: feature 3 at 36.1234, -84.2000: ..."
  std::string Text() const;
};

// Appends the edits of a file, in order, and what is wrong with it. One feature at a time is kept as JSON, so memory
// grows with the edits and not with the text. Edits are complete, except for heights that come from sources.
void ReadEdits(const std::string& path, std::vector<Edit>& edits, std::vector<EditFault>& faults);

// The faults as one message of at most 20 lines.
std::string TextOf(const std::vector<EditFault>& faults);

}  // namespace terrace::dem
