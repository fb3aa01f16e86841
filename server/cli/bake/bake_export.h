// The forms of a bake other than chunks.
#pragma once

#include <cstdint>
#include <stop_token>
#include <string>

#include "bake/place.h"
#include "engine/core/result.h"
#include "server/cli/bake/bake_arguments.h"

namespace terrace::cli {

// kInvalidArgument: something is there other than an empty folder for the form `folder`, or the last part of the path
// is "." or "..".
Result<void> CheckExportPlace(const std::string& out, const std::string& form);

// Whether the `out` of the arguments was made from `baked` by a process that ended before it had removed `baked`.
bool WasExported(const std::string& baked, const BakeArguments& arguments, const bake::BakeIdentity& identity,
                 std::uint64_t generation);

// Removes a bake that was exported.
void RemoveBake(const std::string& baked);

// Converts a finished bake to the form that the arguments name, writes it to their `out`, and removes the bake.
// kUnavailable: the place cannot be written. kInvalidArgument: something is at `out`. kCancelled: stopped.
Result<void> Export(const BakeArguments& arguments, const std::string& baked, const bake::BakeIdentity& identity,
                    std::uint64_t generation, const std::stop_token& stop);

}  // namespace terrace::cli
