// Runs `terrace bake`.
#pragma once

#include "server/cli/bake/bake_arguments.h"

namespace terrace::cli {

// Returns the exit code: 0 the bake, or its shard, is complete; 1 units failed or are missing; 2 the arguments are
// wrong; 128 plus the number of the signal that stopped it.
int Bake(const BakeArguments& arguments);

}  // namespace terrace::cli
