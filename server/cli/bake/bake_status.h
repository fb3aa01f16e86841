// Runs `terrace bake status`.
#pragma once

#include "server/cli/bake/bake_arguments.h"

namespace terrace::cli {

struct StatusView {
  bool json = false;
  bool watch = false;   // prints repeatedly until the job has ended
  bool remove = false;  // removes the job instead
};

// Returns the exit code: 0; 1 there is no such job, it ended incomplete, or Redis cannot be reached; 2 the arguments
// are wrong.
int ShowStatus(const BakeArguments& arguments, const StatusView& view);

}  // namespace terrace::cli
