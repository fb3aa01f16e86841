#include "engine/dem/gdal/operation_pool.h"

#include "engine/dem/gdal/proj_handle.h"

namespace terrace::dem {

ProjContextPtr MakeProjContext() {
  ProjContextPtr context(proj_context_create());
  proj_log_level(context.get(), PJ_LOG_NONE);
  proj_context_set_enable_network(context.get(), 0);
  return context;
}

std::shared_ptr<ProjOperation> OperationPool::Borrow() const {
  if (auto idle = idle_.Take(); idle.item != nullptr) return std::move(idle.item);
  auto operation = std::make_shared<ProjOperation>();
  operation->context = MakeProjContext();
  operation->operation.reset(proj_create(operation->context.get(), pipeline_.c_str()));
  return operation->operation == nullptr ? nullptr : std::move(operation);
}

void OperationPool::Return(std::shared_ptr<ProjOperation> operation) const {
  proj_errno_reset(operation->operation.get());
  idle_.Keep({std::move(operation), 0});
}

}  // namespace terrace::dem
