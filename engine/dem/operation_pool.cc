#include "engine/dem/operation_pool.h"

#include <new>

#include "engine/dem/proj_handle.h"

namespace terrace::dem {

ProjContextPtr MakeProjContext() {
  ProjContextPtr context(proj_context_create());
  proj_log_level(context.get(), PJ_LOG_NONE);
  proj_context_set_enable_network(context.get(), 0);
  return context;
}

OperationPool::OperationPool() = default;
OperationPool::~OperationPool() = default;

std::unique_ptr<ProjOperation> OperationPool::Borrow() const {
  {
    const std::lock_guard lock(mutex_);
    if (!idle_.empty()) {
      std::unique_ptr<ProjOperation> operation = std::move(idle_.back());
      idle_.pop_back();
      return operation;
    }
  }
  auto operation = std::make_unique<ProjOperation>();
  operation->context = MakeProjContext();
  operation->operation.reset(proj_create(operation->context.get(), pipeline_.c_str()));
  return operation->operation == nullptr ? nullptr : std::move(operation);
}

void OperationPool::Return(std::unique_ptr<ProjOperation> operation) const {
  proj_errno_reset(operation->operation.get());
  const std::lock_guard lock(mutex_);
  try {
    idle_.push_back(std::move(operation));
  } catch (const std::bad_alloc&) {
    // It is let go, and set up anew when one is wanted.
  }
}

}  // namespace terrace::dem
