#include "engine/dem/dem_source.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <xxhash.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <string_view>
#include <utility>

#include "engine/core/bytes.h"
#include "engine/core/check.h"
#include "engine/dem/availability.h"
#include "engine/dem/dem_impl.h"
#include "engine/dem/driver_list.h"
#include "engine/dem/footprint.h"
#include "engine/dem/level_plan.h"
#include "engine/dem/raster_file.h"
#include "engine/dem/raster_source.h"
#include "engine/dem/source_policy.h"
#include "engine/geo/octave.h"

namespace terrace::dem {
namespace {

Result<void> CheckOptions(const DemOptions& options) {
  const auto positive = [](double value) { return std::isfinite(value) && value > 0; };
  if (!positive(options.error_fraction)) {
    return MakeError(ErrorCode::kInvalidArgument, "error fraction {}: must be a number above 0",
                     options.error_fraction);
  }
  if (options.finest_error && !positive(*options.finest_error)) {
    return MakeError(ErrorCode::kInvalidArgument, "finest error {} m: must be a number above 0", *options.finest_error);
  }
  if (options.floor && !(std::abs(*options.floor) <= kMaxAbsHeight)) {
    return MakeError(ErrorCode::kInvalidArgument, "floor {} m: must be a height on Earth", *options.floor);
  }
  constexpr double kWidestFeather = 1e6;
  if (!(options.feather >= 0 && options.feather <= kWidestFeather)) {
    return MakeError(ErrorCode::kInvalidArgument, "feather {} m: must be 0 (none) to {:.0f} m", options.feather,
                     kWidestFeather);
  }
  constexpr int kMaxGap = 4096;
  if (options.max_void_gap < 0 || options.max_void_gap > kMaxGap) {
    return MakeError(ErrorCode::kInvalidArgument, "void gap {}: must be 0 (fill nothing) to {} samples",
                     options.max_void_gap, kMaxGap);
  }
  return {};
}

using Rasters = std::vector<std::shared_ptr<const RasterSource>>;

std::uint64_t FingerprintOf(const std::vector<Sheet>& sheets, const DemOptions& options, double floor) {
  // Changes whenever the same files and options would give other heights than before.
  constexpr std::uint32_t kResamplingVersion = 3;
  ByteWriter writer;
  writer.Put(kResamplingVersion);
  for (const Sheet& sheet : sheets) {
    if (&sheet != &sheets.front()) writer.Put(std::uint32_t{0});  // which rasters make one sheet counts, too
    for (const SheetMember& member : sheet.members()) {
      writer.Put(FingerprintOf(member.raster->files(), member.raster->georeference()));
      // What was found or stated of voids decides heights as well.
      if (const SampleRules& rules = member.raster->layout().rules; !rules.marks.empty() || rules.rim > 0) {
        for (const double mark : rules.marks) writer.Put(mark);
        for (const double bound : {rules.lowest, rules.highest, double(rules.rim)}) writer.Put(bound);
      }
    }
    if (const auto& geoid = sheet.vertical().geoid) {
      writer.Put(geoid->files().fingerprint());
      writer.PutBytes(geoid->pipeline());
    }
  }
  writer.Put(options.error_fraction);
  writer.Put(options.finest_error.value_or(0));
  writer.Put(floor);
  writer.Put(options.max_void_gap);
  writer.Put(static_cast<std::uint8_t>(options.voids));
  if (options.feather > 0) writer.Put(options.feather);
  const std::string bytes = writer.Take();
  return XXH3_64bits(bytes.data(), bytes.size());
}

// Names that rasters have: a file of such a name that is none is damaged rather than something else.
bool LooksLikeRaster(const std::string& path) {
  constexpr std::string_view kEndings[] = {".tif", ".tiff", ".hgt", ".hgt.zip", ".hgt.gz", ".dt0", ".dt1",
                                           ".dt2", ".dem",  ".asc", ".img",     ".bil",    ".flt", ".nc"};
  std::string name = path;
  std::ranges::transform(name, name.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return std::ranges::any_of(kEndings, [&](std::string_view ending) { return name.ends_with(ending); });
}

// Those files of folders that are no rasters go away. Which of them look like some, and why they are none.
std::vector<std::string> LeaveOutOthers(std::vector<DemFile>& files) {
  std::vector<std::string> missed, others;
  std::erase_if(files, [&](const DemFile& file) {
    if (!file.may_be_other) return false;
    if (!IsOneLine(file.path)) {
      missed.push_back(EscapeControls(file.path) + " (a control character in its name: rename it)");
      return true;
    }
    if (IsRaster(file.path)) return false;
    const auto format = LeftOutDriverOf(file.path);
    if (format) {
      missed.push_back(fmt::format("{} ({} is not among the allowed_drivers)", file.path, *format));
    } else if (LooksLikeRaster(file.path)) {
      missed.push_back(file.path + " (no raster, whatever its name says: is it whole?)");
    } else {
      others.push_back(file.path);
    }
    return true;
  });
  static constexpr std::size_t kMostNamed = 5;
  const auto tell = [](spdlog::level::level_enum level, const std::vector<std::string>& names) {
    if (names.empty()) return;
    const auto end = names.begin() + static_cast<std::ptrdiff_t>(std::min(names.size(), kMostNamed));
    spdlog::log(level, "left out of a folder: {}{}", fmt::join(names.begin(), end, ", "),
                names.size() > kMostNamed ? fmt::format(" and {} more", names.size() - kMostNamed) : "");
  };
  tell(spdlog::level::warn, missed);
  tell(spdlog::level::debug, others);
  return missed;
}

Result<Rasters> OpenAll(std::vector<DemFile>& files, const DemOptions& options, std::vector<std::string>& left_out) {
  const std::string first = EscapeControls(files.front().path);
  left_out = LeaveOutOthers(files);
  if (files.empty()) {
    return MakeError(
        ErrorCode::kNotFound,
        "{} and its like: none of the files in this folder is a raster; name a folder of rasters or a raster", first);
  }
  const auto handles = std::make_shared<HandleLimit>(options.max_open_sources);
  Rasters rasters;
  std::optional<Error> fault;  // the first
  for (std::size_t i = 0; i < files.size();) {
    const auto progress = [&](double share) {
      options.progress((static_cast<double>(i) + share) / static_cast<double>(files.size()));
    };
    auto raster =
        RasterSource::Open(files[i].path, files[i].options.value_or(options.source), options.cache_dir,
                           options.progress ? progress : std::function<void(double)>(), handles, options.stop);
    // Surveys that were cut into files have some without a height.
    const bool is_nothing = !raster && raster.error().code == ErrorCode::kNotFound;
    if (is_nothing && files[i].may_be_other && files.size() > 1) {
      spdlog::warn("left out of a folder: {}", raster.error().message);
      left_out.push_back(raster.error().message);
      files.erase(files.begin() + static_cast<std::ptrdiff_t>(i));
      continue;
    }
    if (raster) {
      rasters.push_back(*std::move(raster));
    } else {
      if (!options.fault || options.stop.stop_requested()) return tl::unexpected(raster.error());
      options.fault(raster.error());
      if (!fault) fault = raster.error();
    }
    ++i;
  }
  if (fault) return tl::unexpected(*std::move(fault));
  return rasters;
}

// A sixteenth of an octave: tiles of one product differ by less, as meridians converge.
int ResolutionStep(const RasterSource& raster) {
  double power = raster.spacing().finer;
  for (int i = 0; i < 4; ++i) power *= power;  // the sixteenth: squared four times
  return geo::NearestOctave(power);
}

// Of one rank: the sheets that they make, finer ones first, then by path.
Result<void> AddSheets(Rasters rasters, const SheetOptions& options, std::vector<Sheet>& sheets) {
  std::ranges::sort(rasters, {},
                    [](const auto& raster) { return std::pair(ResolutionStep(*raster), raster->info().path); });
  for (SheetPlan& plan : PlanSheets(rasters)) {
    auto sheet = Sheet::Make(std::move(plan), options);
    if (!sheet) return tl::unexpected(sheet.error());
    sheets.push_back(*std::move(sheet));
  }
  return {};
}

Result<std::vector<Sheet>> SheetsOf(const std::vector<DemFile>& files, const Rasters& rasters,
                                    const SheetOptions& options) {
  std::map<int, Rasters> ranks;
  for (std::size_t i = 0; i < files.size(); ++i) ranks[files[i].rank].push_back(rasters[i]);
  std::vector<Sheet> sheets;
  for (auto& [rank, those] : ranks) {
    if (auto added = AddSheets(std::move(those), options, sheets); !added) return tl::unexpected(added.error());
  }
  return sheets;
}

// The smallest box that holds all footprints.
GeoBounds BoundsOf(const Rasters& rasters) {
  if (rasters.size() == 1) return rasters.front()->info().bounds;
  std::vector<Footprint> boxes;
  for (const auto& raster : rasters) boxes.push_back(raster->footprint());
  std::ranges::sort(boxes, {}, &Footprint::west);
  Footprint hull = boxes.front();
  // What lies beyond the antimeridian comes first in the order of longitudes.
  const double beyond = std::ranges::max_element(boxes, {}, &Footprint::east)->east - 360;
  double covered = std::max(hull.east, beyond), gap = 0, gap_end = hull.west;  // the widest gap ends at gap_end
  for (const Footprint& box : boxes) {
    hull.south = std::min(hull.south, box.south);
    hull.north = std::max(hull.north, box.north);
    if (box.west - covered > gap) {
      gap = box.west - covered;
      gap_end = box.west;
    }
    covered = std::max(covered, box.east);
  }
  const double last_gap = boxes.front().west + 360 - covered;
  constexpr double kNoGap = 1e-9;  // pieces of one grid meet as exactly as their corners are rounded
  if (std::max(gap, last_gap) <= kNoGap) return {-180, hull.south, 180, hull.north};
  const double west = last_gap >= gap ? boxes.front().west : gap_end;
  const double east = west + 360 - std::max(gap, last_gap);
  return {west, hull.south, east > 180 ? east - 360 : east, hull.north};
}

DemInfo InfoOf(const std::vector<Sheet>& sheets, const Rasters& rasters, const DemOptions& options) {
  DemInfo info;
  info.heights = sheets.front().EllipsoidalRange();
  info.bounds = BoundsOf(rasters);
  for (const Sheet& sheet : sheets) {
    const HeightRange ellipsoidal = sheet.EllipsoidalRange();
    info.heights.min = std::min(info.heights.min, ellipsoidal.min);
    info.heights.max = std::max(info.heights.max, ellipsoidal.max);
    for (const SheetMember& member : sheet.members()) {
      info.sources.push_back(member.raster->info());
      info.sources.back().ellipsoidal = ellipsoidal;
    }
    info.max_mercator_depth = std::max(info.max_mercator_depth, DeepestMercator(sheet.spacing()));
  }
  info.floor = RoundHeight(options.floor.value_or(info.heights.min));
  return info;
}

std::vector<Reach> ReachesOf(const std::vector<Sheet>& sheets, const DemOptions& options) {
  const double finest =
      std::ranges::min_element(sheets, {}, [](const Sheet& s) { return s.spacing().finer; })->spacing().finer;
  std::vector<Reach> reaches;
  for (const Sheet& sheet : sheets) {
    // An error that the operator wishes for is for the finest source; it is worth as many levels more to the others.
    const auto goal =
        options.finest_error ? std::optional(*options.finest_error * (sheet.spacing().finer / finest)) : std::nullopt;
    const int depth = DeepestLevel(sheet.spacing(), options.error_fraction, goal);
    for (const SheetMember& member : sheet.members()) reaches.push_back({member.raster->footprint(), depth});
  }
  return reaches;
}

}  // namespace

DemSource::DemSource(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
DemSource::~DemSource() = default;

Result<std::unique_ptr<DemSource>> DemSource::Open(const std::string& path, const DemOptions& options) {
  return Open(std::vector<DemFile>{{path}}, options);
}

Result<std::unique_ptr<DemSource>> DemSource::Open(std::vector<DemFile> files, const DemOptions& options) {
  TERRACE_CHECK(!files.empty());
  if (auto checked = CheckOptions(options); !checked)
    return MakeError(checked.error().code, "{}: {}", files.front().path, checked.error().message);
  std::vector<std::string> left_out;
  const auto rasters = OpenAll(files, options, left_out);
  if (!rasters) return tl::unexpected(rasters.error());
  auto sheets = SheetsOf(files, *rasters, {options.max_void_gap, options.voids, options.feather});
  if (!sheets) return tl::unexpected(sheets.error());

  auto impl = std::make_unique<Impl>();
  impl->sheets = *std::move(sheets);
  impl->has_feather = options.feather > 0;
  impl->index = IndexOf(impl->sheets);
  const auto finest = std::ranges::min_element(impl->sheets, {}, [](const Sheet& s) { return s.spacing().finer; });
  impl->lattices = PlanLattices(finest->spacing());
  impl->info = InfoOf(impl->sheets, *rasters, options);
  impl->info.left_out = std::move(left_out);
  impl->available = AvailableTiles(ReachesOf(impl->sheets, options));
  impl->info.max_level = static_cast<int>(impl->available.size()) - 1;
  impl->floor = static_cast<float>(impl->info.floor);
  for (const Sheet& sheet : impl->sheets) {
    if (const auto& geoid = sheet.vertical().geoid) {
      auto undulations = Undulations::OfEarth(geoid);
      if (!undulations) return tl::unexpected(undulations.error());
      impl->floor_undulations = *std::move(undulations);
    }
  }
  impl->fingerprint = FingerprintOf(impl->sheets, options, impl->floor);
  return std::unique_ptr<DemSource>(new DemSource(std::move(impl)));
}

const DemInfo& DemSource::info() const { return impl_->info; }
int DemSource::max_level() const { return impl_->info.max_level; }
geo::Lattice DemSource::LatticeOf(int level) const { return impl_->LatticeOf(level); }
std::uint64_t DemSource::fingerprint() const { return impl_->fingerprint; }

StampedFiles DemSource::files() const {
  StampedFiles all;
  std::set<const Geoid*> geoids;
  for (const Sheet& sheet : impl_->sheets) {
    for (const SheetMember& member : sheet.members()) all.Append(member.raster->files());
    // Sheets mostly share one.
    const auto& geoid = sheet.vertical().geoid;
    if (geoid && geoids.insert(geoid.get()).second) all.Append(geoid->files());
  }
  return all;
}

const std::vector<geo::TileRange>& DemSource::Available(int level) const {
  static const std::vector<geo::TileRange> none;
  if (level < 0 || level > max_level()) return none;
  return impl_->available[static_cast<std::size_t>(level)];
}

const std::vector<std::vector<geo::TileRange>>& DemSource::Availability() const { return impl_->available; }

bool DemSource::IsAvailable(const geo::TileKey& key) const {
  return geo::IsValid(key) &&
         std::ranges::any_of(Available(key.level), [&](const geo::TileRange& range) { return range.Contains(key); });
}

HeightRange DemSource::RangeBound(const geo::TileKey& key) const {
  TERRACE_CHECK(geo::IsValid(key));
  return impl_->RangeBound(key);
}

Result<TileHeights> DemSource::Read(const geo::TileKey& key, std::stop_token stop) const {
  TERRACE_CHECK(geo::IsValid(key));
  return impl_->Read(key, Counting::kEllipsoid, stop);
}

Result<TileHeights> DemSource::ReadAsCounted(const geo::TileKey& key, std::stop_token stop) const {
  TERRACE_CHECK(geo::IsValid(key));
  return impl_->Read(key, Counting::kAsSource, stop);
}

SampleCounts DemSource::CountSamples() const {
  SampleCounts sum;
  for (const Sheet& sheet : impl_->sheets) {
    const SampleCounts counts = sheet.CountSamples();
    sum.measured += counts.measured;
    sum.filled += counts.filled;
    sum.voids += counts.voids;
  }
  return sum;
}

bool DemSource::has_datum() const {
  return std::ranges::none_of(impl_->info.sources, [](const RasterInfo& raster) { return raster.counts_from.empty(); });
}

bool DemSource::converts() const { return impl_->floor_undulations != nullptr; }

Result<std::vector<float>> DemSource::ReadNodes(int level, const NodeWindow& window, std::stop_token stop) const {
  TERRACE_CHECK(level >= 0 && level <= geo::kMaxLevel && window.columns > 0 && window.rows > 0);
  TERRACE_CHECK(window.row >= 0 && window.row + window.rows - 1 <= LatticeOf(level).rows());
  return impl_->ReadNodes(level, window, Counting::kEllipsoid, fmt::format("an area of level {}", level), stop);
}

Result<std::vector<float>> DemSource::ReadMercator(int depth, const NodeWindow& window, std::stop_token stop) const {
  TERRACE_CHECK(depth >= 0 && depth <= geo::kMaxLevel && window.columns > 0 && window.rows > 0);
  TERRACE_CHECK(window.row >= 0 && window.row + window.rows <= geo::MercatorGrid{depth}.rows());
  return impl_->ReadMercator(depth, window, stop);
}

Result<std::vector<float>> DemSource::ReadPoints(std::span<const GeoPosition> points, HeightDatum datum,
                                                 std::stop_token stop, std::span<std::uint8_t> filled) const {
  TERRACE_CHECK(filled.empty() || filled.size() == points.size());
  return impl_->ReadPoints(points, datum, filled, stop);
}

}  // namespace terrace::dem
