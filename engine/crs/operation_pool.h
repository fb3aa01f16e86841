// One pinned PROJ operation for many threads: each thread borrows a copy with its own context and returns it. An
// IdlePool keeps unused copies, because a copy holds the files of its grids open.
#pragma once

#include <string>
#include <utility>

#include "engine/common/idle_pool.h"

namespace terrace::dem {

struct ProjOperation;

class OperationPool {
 public:
  // The pipeline in PROJ's notation. Set it once, before the first Borrow.
  void set_pipeline(std::string pipeline) { pipeline_ = std::move(pipeline); }
  const std::string& pipeline() const { return pipeline_; }

  // An empty handle: PROJ cannot create the operation. If it could before, memory or file descriptors have run out.
  IdlePool<ProjOperation>::Handle Borrow() const;

 private:
  std::string pipeline_;
  mutable IdlePool<ProjOperation> idle_;  // never cleared: users of the operation check its grids
};

}  // namespace terrace::dem
