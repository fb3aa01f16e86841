// Runs `terrace bake`.
#pragma once

#include "server/cli/bake/bake_arguments.h"

namespace terrace::cli {

// Returns the exit code: 0 the bake, or its shard, is complete; 1 it is not complete: files failed or are missing, or a
// source, the place or Redis cannot be used; 2 the arguments are wrong, or do not fit the place or the job; 128 plus
// the number of the signal that stopped the bake.
int Bake(const BakeArguments& arguments);

}  // namespace terrace::cli
