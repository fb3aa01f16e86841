// The forms of a bake.
#pragma once

#include <cstdint>
#include <stop_token>
#include <string>
#include <vector>

#include "bake/baker.h"
#include "bake/place.h"
#include "engine/core/result.h"
#include "server/cli/bake/bake_arguments.h"

namespace terrace::cli {

// kInvalidArgument: something is there other than an empty folder for the form `folder`, or the last part of the path
// is "." or "..".
Result<void> CheckExportPlace(const std::string& out, const std::string& form);

// kInvalidArgument: readers would refuse what would be baked into these places, because it states too many tiles and
// units. The targets have their places and identities.
Result<void> CheckSizes(const BakeArguments& arguments, const std::vector<bake::Target>& targets);

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
