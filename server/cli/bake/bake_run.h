// Runs `terrace bake`.
#pragma once

#include "server/cli/bake/bake_arguments.h"

namespace terrace::cli {

// Returns the exit code: 0 the bake is complete, or the shard is; 1 units failed or are missing; 2 the arguments make
// no sense; 128 and the number of the signal that stopped it.
int Bake(const BakeArguments& arguments);

}  // namespace terrace::cli
