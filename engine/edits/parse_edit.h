// One GeoJSON feature as an edit.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "engine/edits/edit.h"
#include "engine/edits/read_edits.h"

namespace terrace::dem {

// Returns nothing for a feature without properties.terrain, and for a wrong one, whose faults are appended. `file` and
// `feature` name the feature in the edit and in faults.
std::optional<Edit> ParseEdit(const nlohmann::json& json, const std::string& file, std::size_t feature,
                              std::vector<EditFault>& faults);

}  // namespace terrace::dem
