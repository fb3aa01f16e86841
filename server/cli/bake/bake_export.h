// The forms of a bake other than chunks.
#pragma once

#include <cstdint>
#include <stop_token>
#include <string>

#include "bake/place.h"
#include "engine/core/result.h"
#include "server/cli/bake/bake_arguments.h"

namespace terrace::cli {

// kInvalidArgument: something is there.
Result<void> CheckExportPlace(const std::string& out);

// For an `out` that is there: whether `baked` still holds the finished bake of these arguments, because the process
// that wrote `out` ended before it had removed `baked`. If so, removes `baked`.
bool RemoveIfExported(const std::string& baked, const bake::BakeIdentity& identity, std::uint64_t generation);

// Converts a finished bake to the form that the arguments name, writes it to their `out`, and removes the bake.
// kUnavailable: the place cannot be written. kCancelled: stopped.
Result<void> Export(const BakeArguments& arguments, const std::string& baked, const std::stop_token& stop);

}  // namespace terrace::cli
