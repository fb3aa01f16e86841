// Owning pointers to PROJ objects. For code that calls PROJ itself; other code uses operation_pool.h.
#pragma once

#include <proj.h>

#include <memory>
#include <string>
#include <vector>

namespace terrace::dem {

struct ProjDestroy {
  void operator()(PJ_CONTEXT* context) const { proj_context_destroy(context); }
  void operator()(PJ* object) const { proj_destroy(object); }
  void operator()(PJ_OBJ_LIST* list) const { proj_list_destroy(list); }
  void operator()(PJ_OPERATION_FACTORY_CONTEXT* factory) const { proj_operation_factory_context_destroy(factory); }
};
using ProjContextPtr = std::unique_ptr<PJ_CONTEXT, ProjDestroy>;
using ProjObjectPtr = std::unique_ptr<PJ, ProjDestroy>;
using ProjListPtr = std::unique_ptr<PJ_OBJ_LIST, ProjDestroy>;
using ProjFactoryPtr = std::unique_ptr<PJ_OPERATION_FACTORY_CONTEXT, ProjDestroy>;

// Creates a context without log output and without network access, so that results of operations do not depend on the
// network.
ProjContextPtr MakeProjContext();

// A file of numbers that an operation reads.
struct ProjGrid {
  std::string name;
  std::string file;  // empty: not installed
  std::string url;   // empty: no known download
};
std::vector<ProjGrid> GridsOf(PJ_CONTEXT* context, const PJ* operation);

// Used by one thread at a time.
struct ProjOperation {
  ProjContextPtr context;  // outlives the operation made in it
  ProjObjectPtr operation;
};

}  // namespace terrace::dem
