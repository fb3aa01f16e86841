// One pinned PROJ operation for many threads: each borrows a copy with a context of its own, and gives it back.
#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

namespace terrace::dem {

struct ProjOperation;

class OperationPool {
 public:
  OperationPool();
  ~OperationPool();

  // As PROJ writes it. Set once, before the first Borrow.
  void set_pipeline(std::string pipeline) { pipeline_ = std::move(pipeline); }
  const std::string& pipeline() const { return pipeline_; }

  // Null: PROJ cannot set it up. Where it could before, memory or descriptors for its grids are short.
  std::unique_ptr<ProjOperation> Borrow() const;
  // Forgets PROJ's error of the last use.
  void Return(std::unique_ptr<ProjOperation> operation) const;

 private:
  std::string pipeline_;
  mutable std::mutex mutex_;
  mutable std::vector<std::unique_ptr<ProjOperation>> idle_;  // guarded by mutex_
};

}  // namespace terrace::dem
