#include "engine/dem/projector.h"

#include <proj.h>

#include <cmath>
#include <limits>

#include "engine/core/check.h"

namespace terrace::dem {
namespace {

struct Destroy {
  void operator()(PJ_CONTEXT* context) const { proj_context_destroy(context); }
  void operator()(PJ* operation) const { proj_destroy(operation); }
};
using ContextPtr = std::unique_ptr<PJ_CONTEXT, Destroy>;
using OperationPtr = std::unique_ptr<PJ, Destroy>;

ContextPtr MakeContext() {
  ContextPtr context(proj_context_create());
  proj_log_level(context.get(), PJ_LOG_NONE);
  proj_context_set_enable_network(context.get(), 0);
  return context;
}

// Of all operations between WGS 84 and the CRS, the one PROJ uses at `centre`.
OperationPtr OperationAt(PJ_CONTEXT* context, const std::string& wkt, Position centre) {
  const OperationPtr any(proj_create_crs_to_crs(context, "EPSG:4326", wkt.c_str(), nullptr));
  if (any == nullptr) return nullptr;
  OperationPtr ordered(proj_normalize_for_visualization(context, any.get()));
  if (ordered == nullptr) return nullptr;
  const PJ_COORD there = proj_trans(ordered.get(), PJ_INV, proj_coord(centre.x, centre.y, 0, HUGE_VAL));
  proj_trans(ordered.get(), PJ_FWD, there);
  OperationPtr used(proj_trans_get_last_used_operation(ordered.get()));
  return used != nullptr ? std::move(used) : std::move(ordered);
}

}  // namespace

struct Projector::Operation {
  ContextPtr context;  // outlives the operation made in it
  OperationPtr operation;
};

Projector::~Projector() = default;

Result<std::shared_ptr<const Projector>> Projector::Make(const std::string& wkt, Position centre) {
  const ContextPtr context = MakeContext();
  const OperationPtr operation = OperationAt(context.get(), wkt, centre);
  const char* pipeline =
      operation == nullptr ? nullptr : proj_as_proj_string(context.get(), operation.get(), PJ_PROJ_5, nullptr);
  if (pipeline == nullptr) {
    const int error = proj_context_errno(context.get());
    return MakeError(ErrorCode::kInvalidArgument,
                     "no transformation from WGS 84 to its coordinate reference system ({})",
                     error == 0 ? "none known" : proj_context_errno_string(context.get(), error));
  }
  const std::shared_ptr<Projector> projector(new Projector);
  projector->pipeline_ = pipeline;
  // "+proj=noop" or "proj=noop", as the PROJ version likes it.
  if (projector->pipeline_.starts_with("+")) projector->pipeline_.erase(0, 1);
  const PJ_PROJ_INFO info = proj_pj_info(operation.get());
  projector->description_ = info.description == nullptr ? projector->pipeline_ : info.description;
  std::unique_ptr<Operation> first = projector->Borrow();
  if (first == nullptr) {
    return MakeError(ErrorCode::kInvalidArgument, "the transformation from WGS 84 cannot be set up: {}",
                     projector->pipeline_);
  }
  projector->Return(std::move(first));
  return projector;
}

std::unique_ptr<Projector::Operation> Projector::Borrow() const {
  {
    const std::lock_guard lock(mutex_);
    if (!idle_.empty()) {
      std::unique_ptr<Operation> operation = std::move(idle_.back());
      idle_.pop_back();
      return operation;
    }
  }
  auto operation = std::make_unique<Operation>();
  operation->context = MakeContext();
  operation->operation.reset(proj_create(operation->context.get(), pipeline_.c_str()));
  return operation->operation == nullptr ? nullptr : std::move(operation);
}

void Projector::Return(std::unique_ptr<Operation> operation) const {
  const std::lock_guard lock(mutex_);
  idle_.push_back(std::move(operation));
}

void Projector::Transform(std::span<Position> positions, bool forward) const {
  std::unique_ptr<Operation> operation = Borrow();
  // The same string was set up once in Make. Where it cannot be now, for want of memory or of descriptors for its grids,
  // no position is known; the caller's read fails.
  if (operation == nullptr) throw std::bad_alloc();
  for (Position& position : positions) {
    const PJ_COORD result = proj_trans(operation->operation.get(), forward ? PJ_FWD : PJ_INV,
                                       proj_coord(position.x, position.y, 0, HUGE_VAL));
    const bool found = std::isfinite(result.xy.x) && std::isfinite(result.xy.y);
    constexpr double kNowhere = std::numeric_limits<double>::quiet_NaN();
    position = found ? Position{result.xy.x, result.xy.y} : Position{kNowhere, kNowhere};
  }
  proj_errno_reset(operation->operation.get());
  Return(std::move(operation));
}

void Projector::Forward(std::span<Position> positions) const { Transform(positions, true); }
void Projector::Inverse(std::span<Position> positions) const { Transform(positions, false); }

}  // namespace terrace::dem
