#include "engine/crs/projector.h"

#include <cmath>
#include <limits>
#include <map>
#include <mutex>
#include <new>
#include <utility>
#include <vector>

#include "engine/crs/proj_handle.h"

namespace terrace::dem {
namespace {

// Returns the operation between WGS 84 and the CRS that PROJ uses at `centre`. `is_only`: it is the only one.
ProjObjectPtr OperationAt(PJ_CONTEXT* context, const std::string& wkt, Position centre, bool& is_only) {
  const ProjObjectPtr any(proj_create_crs_to_crs(context, "EPSG:4326", wkt.c_str(), nullptr));
  if (any == nullptr) return nullptr;
  ProjObjectPtr ordered(proj_normalize_for_visualization(context, any.get()));
  if (ordered == nullptr) return nullptr;
  is_only = proj_get_type(ordered.get()) != PJ_TYPE_UNKNOWN;  // unknown: the type of a set of operations
  const PJ_COORD there = proj_trans(ordered.get(), PJ_INV, proj_coord(centre.x, centre.y, 0, HUGE_VAL));
  proj_trans(ordered.get(), PJ_FWD, there);
  ProjObjectPtr used(proj_trans_get_last_used_operation(ordered.get()));
  return used != nullptr ? std::move(used) : std::move(ordered);
}

// Most reference systems have only one operation, which thousands of sources share; PROJ takes milliseconds to look it
// up. Stores `made` if it is not null. Null: none is stored, or its grids have changed.
std::shared_ptr<const Projector> FindOrShare(const std::string& wkt, std::shared_ptr<const Projector> made) {
  static std::mutex mutex;
  // Never destroyed: at the end of the process, what GDAL and PROJ need to free their objects may be gone.
  static auto& shared = *new std::map<std::string, std::shared_ptr<const Projector>>;
  const std::lock_guard lock(mutex);
  if (made != nullptr) return shared.insert_or_assign(wkt, std::move(made)).first->second;
  const auto found = shared.find(wkt);
  // A replaced grid is read again.
  return found == shared.end() || found->second->grids().FirstChanged() ? nullptr : found->second;
}

}  // namespace

Result<std::shared_ptr<const Projector>> Projector::Make(const std::string& wkt, Position centre) {
  if (auto known = FindOrShare(wkt, nullptr)) return known;
  const ProjContextPtr context = MakeProjContext();
  bool is_only = false;
  const ProjObjectPtr operation = OperationAt(context.get(), wkt, centre, is_only);
  const char* pipeline =
      operation == nullptr ? nullptr : proj_as_proj_string(context.get(), operation.get(), PJ_PROJ_5, nullptr);
  if (pipeline == nullptr) {
    const int error = proj_context_errno(context.get());
    return MakeError(ErrorCode::kInvalidArgument,
                     "no transformation from WGS 84 to its coordinate reference system ({})",
                     error == 0 ? "none known" : proj_context_errno_string(context.get(), error));
  }
  const std::shared_ptr<Projector> projector(new Projector);
  // "+proj=noop" or "proj=noop", depending on the version of PROJ.
  projector->operations_.set_pipeline(*pipeline == '+' ? pipeline + 1 : pipeline);
  const PJ_PROJ_INFO info = proj_pj_info(operation.get());
  projector->description_ = info.description == nullptr ? projector->pipeline() : info.description;
  std::vector<std::string> files;
  for (const ProjGrid& grid : GridsOf(context.get(), operation.get())) files.push_back(grid.file);
  projector->grids_ = StampedFiles(files);
  if (!projector->operations_.Borrow()) {
    return MakeError(ErrorCode::kInvalidArgument, "the transformation from WGS 84 cannot be set up: {}",
                     projector->pipeline());
  }
  return is_only ? FindOrShare(wkt, projector) : projector;
}

void Projector::Transform(std::span<Position> positions, bool forward) const {
  const IdlePool<ProjOperation>::Handle operation = operations_.Borrow();
  // Make has created the operation before, so memory or descriptors for its grids have run out. No position is known;
  // the caller's read fails.
  if (!operation) throw std::bad_alloc();
  for (Position& position : positions) {
    const PJ_COORD result = proj_trans(operation->operation.get(), forward ? PJ_FWD : PJ_INV,
                                       proj_coord(position.x, position.y, 0, HUGE_VAL));
    const bool found = std::isfinite(result.xy.x) && std::isfinite(result.xy.y);
    constexpr double kNowhere = std::numeric_limits<double>::quiet_NaN();
    position = found ? Position{result.xy.x, result.xy.y} : Position{kNowhere, kNowhere};
  }
}

void Projector::Forward(std::span<Position> positions) const { Transform(positions, true); }
void Projector::Inverse(std::span<Position> positions) const { Transform(positions, false); }

Result<std::string> EpsgWkt(const std::string& code) {
  static std::mutex mutex;
  static std::map<std::string, std::string> known;
  {
    const std::lock_guard lock(mutex);
    if (const auto found = known.find(code); found != known.end()) return found->second;
  }
  const ProjContextPtr context = MakeProjContext();
  const ProjObjectPtr crs(proj_create_from_database(context.get(), "EPSG", code.c_str(), PJ_CATEGORY_CRS,
                                                    /*usePROJAlternativeGridNames=*/0, nullptr));
  const char* const options[] = {"MULTILINE=NO", nullptr};
  const char* text = crs == nullptr ? nullptr : proj_as_wkt(context.get(), crs.get(), PJ_WKT2_2019, options);
  if (text != nullptr) {
    const std::lock_guard lock(mutex);
    return known.emplace(code, text).first->second;
  }
  if (proj_context_get_database_metadata(context.get(), "EPSG.VERSION") == nullptr) {
    return MakeError(ErrorCode::kUnavailable, "PROJ cannot read its database");
  }
  return MakeError(ErrorCode::kInvalidArgument, "PROJ knows no EPSG:{}", code);
}

}  // namespace terrace::dem
