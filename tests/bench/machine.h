// What a measurement depends on besides the code: goes into every file of results.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace terrace::bench {

// {"cpu", "cores", "load", "compiler", "flags", "commit", "date"}; "unknown" for what cannot be found out. "load": how
// many threads wanted a core in the minute before.
nlohmann::ordered_json MachineContext();

// The first line that a shell command prints; empty if it fails.
std::string FirstLineOf(const std::string& command);

}  // namespace terrace::bench
