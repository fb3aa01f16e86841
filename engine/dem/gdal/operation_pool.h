// One pinned PROJ operation for many threads: each borrows a copy with a context of its own, and gives it back. What is
// not in use is kept as IdlePool says, for a copy holds the files of its grids open.
#pragma once

#include <string>
#include <utility>

#include "engine/dem/common/idle_pool.h"

namespace terrace::dem {

struct ProjOperation;

class OperationPool {
 public:
  // As PROJ writes it. Set once, before the first Borrow.
  void set_pipeline(std::string pipeline) { pipeline_ = std::move(pipeline); }
  const std::string& pipeline() const { return pipeline_; }

  // False: PROJ cannot set it up. Where it could before, memory or descriptors for its grids are short.
  IdlePool<ProjOperation>::Handle Borrow() const;

 private:
  std::string pipeline_;
  mutable IdlePool<ProjOperation> idle_;  // never cleared: grids are looked at by whoever uses the operation
};

}  // namespace terrace::dem
