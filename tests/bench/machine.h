// What a measurement depends on besides the code. Every file of results contains it.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace terrace::bench {

// {"cpu", "cores", "load", "compiler", "flags", "commit", "date"}; unknown values are "unknown". "load" is the load
// average of the last minute.
nlohmann::ordered_json MachineContext();

// The first line that a shell command prints; empty if it fails.
std::string FirstLineOf(const std::string& command);

}  // namespace terrace::bench
