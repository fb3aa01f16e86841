#include "bake/find_missing.h"

#include <algorithm>
#include <string>

#include "archive/pmtiles/pmtiles_file.h"
#include "archive/pmtiles_mapping.h"
#include "archive/unit_name.h"
#include "bake/unit_key.h"

namespace terrace::bake {
namespace {

bool IsThere(const tiler::Dataset& dataset, const Target& target, const Unit& unit) {
  const std::string path = target.place + "/" + archive::UnitPath(unit.name);
  const auto file = archive::PmtilesFile::Open(path);
  return file && archive::UnitKeyIn((*file)->metadata()) == UnitKey(dataset, target.manifest, unit);
}

}  // namespace

Result<std::vector<std::size_t>> FindMissing(const tiler::Dataset& dataset, const std::vector<Target>& targets,
                                             const UnitPlan& plan, const std::stop_token& stop) {
  std::vector<std::size_t> missing;
  for (std::size_t i = 0; i < plan.units.size(); ++i) {
    if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "stopped while units were looked for");
    const UnitPlan::Entry& entry = plan.units[i];
    const bool is_there = std::ranges::all_of(
        entry.targets, [&](std::size_t target) { return IsThere(dataset, targets[target], entry.unit); });
    if (!is_there) missing.push_back(i);
  }
  return missing;
}

}  // namespace terrace::bake
