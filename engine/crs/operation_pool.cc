#include "engine/crs/operation_pool.h"

#include "engine/crs/proj_handle.h"

namespace terrace::dem {

ProjContextPtr MakeProjContext() {
  ProjContextPtr context(proj_context_create());
  proj_log_level(context.get(), PJ_LOG_NONE);
  proj_context_set_enable_network(context.get(), 0);
  return context;
}

IdlePool<ProjOperation>::Handle OperationPool::Borrow() const {
  IdlePool<ProjOperation>::Handle handle = idle_.Take();
  if (handle) {
    proj_errno_reset(handle->operation.get());  // of the last use
    return handle;
  }
  auto operation = std::make_shared<ProjOperation>();
  operation->context = MakeProjContext();
  operation->operation.reset(proj_create(operation->context.get(), pipeline_.c_str()));
  if (operation->operation != nullptr) handle.Set(std::move(operation));
  return handle;
}

std::vector<ProjGrid> GridsOf(PJ_CONTEXT* context, const PJ* operation) {
  std::vector<ProjGrid> grids;
  const int count = proj_coordoperation_get_grid_used_count(context, operation);
  for (int i = 0; i < count; ++i) {
    const char *name = nullptr, *file = nullptr, *url = nullptr;
    proj_coordoperation_get_grid_used(context, operation, i, &name, &file, nullptr, &url, nullptr, nullptr, nullptr);
    const auto text = [](const char* value) { return std::string(value == nullptr ? "" : value); };
    grids.push_back({text(name), text(file), text(url)});
  }
  return grids;
}

}  // namespace terrace::dem
