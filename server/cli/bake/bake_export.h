// The forms of a bake other than chunks.
#pragma once

#include <stop_token>
#include <string>

#include "engine/core/result.h"
#include "server/cli/bake/bake_arguments.h"

namespace terrace::cli {

// kInvalidArgument: something is there.
Result<void> CheckExportPlace(const std::string& out);

// Converts a finished bake to the form that the arguments name, writes it to their `out`, and removes the bake.
// kUnavailable: the place cannot be written. kCancelled: stopped.
Result<void> Export(const BakeArguments& arguments, const std::string& baked, const std::stop_token& stop);

}  // namespace terrace::cli
