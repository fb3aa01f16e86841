#include "server/cli/bake/bake_run.h"

#include <fmt/format.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <system_error>
#include <utility>

#include "archive/files/bucket.h"
#include "archive/files/input_file.h"
#include "bake/cell_list.h"
#include "bake/estimate.h"
#include "bake/place.h"
#include "engine/core/elapsed_time.h"
#include "engine/core/plain_number.h"
#include "engine/gdal/gdal_runtime.h"
#include "engine/gdal/remote_file.h"
#include "engine/gdal/source_policy.h"
#include "engine/geo/error_ladder.h"
#include "engine/statistics/cache_folder.h"
#include "server/cli/bake/bake_display.h"
#include "server/cli/bake/bake_export.h"
#include "server/cli/bake/bake_queue.h"
#include "server/cli/bake/seed_cache.h"
#include "server/cli/bake/stop_signals.h"
#include "server/cli/common/command.h"
#include "server/cli/common/open_cache.h"
#include "server/cli/common/open_dataset.h"
#include "server/cli/common/progress.h"
#include "server/cli/common/source_files.h"
#include "tiler/tile/build_id.h"

namespace terrace::cli {
namespace {

using Clock = std::chrono::steady_clock;

int StopCode(const StopSignals& signals) { return 128 + signals.signal(); }

// Only ranges of tiles are made: no raster is opened.
int PlanFromCells(const BakeArguments& arguments, const bake::BakeRequest& request) {
  constexpr std::uint64_t kMaxBytes = std::uint64_t{1} << 30;
  const Result<std::string> cells = archive::ReadFile(arguments.cell_list, kMaxBytes);
  if (!cells) {
    return cli::Fail(cells.error().message + "; give a file with a cell such as N46E008 on each line", kExitFailure);
  }
  constexpr double kErrorFraction = 0.5;
  auto tiles = bake::PlanCells(*cells, arguments.arc_seconds, kErrorFraction);
  if (!tiles) return cli::Fail(arguments.cell_list + ": " + tiles.error().message, kExitUsage);
  const int deepest = static_cast<int>(tiles->size()) - 1;
  if (request.levels && (request.levels->first > 0 || request.levels->second > deepest)) {
    return cli::Fail(
        fmt::format("--levels {}: must begin at level 0; the catalogue has levels 0 to {}", arguments.levels, deepest),
        kExitUsage);
  }
  if (request.bbox) *tiles = bake::TilesWithin(*tiles, *request.bbox);
  if (request.levels) tiles->resize(static_cast<std::size_t>(request.levels->second) + 1);
  const bake::Estimate estimate = bake::EstimateWith(*tiles, arguments.bytes_per_tile, arguments.milliseconds_per_tile);
  fmt::print("{}", arguments.json ? EstimateJson(estimate) + "\n" : EstimateText(estimate));
  return kExitOk;
}

// Whoever names a bucket in the command line allows it.
Result<void> SetPolicy(const BakeArguments& arguments, const config::Config& config) {
  dem::SourcePolicy policy{config.data_roots, config.allowed_prefixes, config.allowed_drivers};
  if (archive::IsBucket(arguments.out)) policy.prefixes.push_back(arguments.out + "/");
  if (dem::IsGdalName(arguments.update)) policy.prefixes.push_back(arguments.update + "/");
  if (!policy.prefixes.empty()) archive::LimitRequests();
  return config.datasets.empty() && policy.prefixes.empty() ? dem::AllowVrts() : dem::SetSourcePolicy(policy);
}

Result<tiler::Dataset> OpenDataset(const BakeArguments& arguments, const BakeInput& input, const StopSignals& signals) {
  const Result<void> policy = SetPolicy(arguments, input.config);
  if (!policy) return tl::unexpected(policy.error());
  if (const auto readable = CheckReadable(input.dataset); !readable) return tl::unexpected(readable.error());
  if (const auto allowed = CheckSourcePolicy(input.dataset); !allowed) return tl::unexpected(allowed.error());
  dem::SetGdalCache(input.config.gdal_cache_bytes);
  const dem::RasterCache cache = OpenStatisticsCache(input.config);
  Progress progress((cache.folder ? "preparing " : "reading ") + NameOf(input.dataset.sources),
                    FileCount(input.dataset.sources));
  auto dataset = cli::OpenDataset(input.dataset, cache, TERRACE_VERSION, progress.Callback(), signals.token());
  if (cache.folder && dataset) cache.folder->Trim();
  return dataset;
}

bake::BakeIdentity IdentityOf(const BakeArguments& arguments, const tiler::Dataset& dataset,
                              const std::vector<bake::Target>& targets) {
  std::string error = "default";
  if (arguments.error > 0) error = PlainNumber(arguments.error) + " m";
  if (arguments.fraction > 0) error = PlainNumber(arguments.fraction) + " of the level's";
  std::string extensions;  // of terrain; other formats have none
  for (const auto& [extension, name] : {std::pair(&proto::TileExtensions::normals, "octvertexnormals"),
                                        std::pair(&proto::TileExtensions::water_mask, "watermask"),
                                        std::pair(&proto::TileExtensions::metadata, "metadata")}) {
    const auto is_on = [wanted = extension](const bake::Target& target) {
      return target.manifest.kind.extensions.*wanted;
    };
    if (std::ranges::any_of(targets, is_on)) extensions += (extensions.empty() ? "" : ",") + std::string(name);
  }
  return {{{"dataset", dataset.name},
           {"format", arguments.format},
           {"levels", arguments.levels.empty() ? "all" : arguments.levels},
           {"bbox", arguments.bbox.empty() ? "none" : arguments.bbox},
           {"error", error},
           {"extensions", extensions.empty() ? "none" : extensions},
           {"gzip", arguments.no_gzip ? "no" : "yes"},
           {"dataset options and encoders (hash)", fmt::format("{:016x}", GenerationOf(dataset, /*heights=*/0))}}};
}

// A bake that was killed between two manifests has those of some formats. The others have no old units.
Result<void> ReadOld(const std::string& place, std::vector<bake::Target>& targets) {
  std::optional<Error> missing;
  for (bake::Target& target : targets) {
    const std::string folder = bake::ArchivePlace(place, target.manifest, false);
    target.old_place = folder;
    auto manifest = archive::ReadManifest(folder);
    if (!manifest && manifest.error().code == ErrorCode::kNotFound) {
      target.old_place = place;
      manifest = archive::ReadManifest(place);
    }
    if (!manifest) {
      const Error error{manifest.error().code, "--update: " + manifest.error().message};
      if (error.code != ErrorCode::kNotFound) return tl::unexpected(error);
      missing = error;
      continue;
    }
    if (archive::IsSingleFile(place)) {
      return MakeError(ErrorCode::kInvalidArgument, "--update {}: is one file without units; give a bake in chunks",
                       place);
    }
    for (const archive::UnitEntry& unit : manifest->units) target.old_units.emplace(unit.name, unit);
  }
  const auto has_none = [](const bake::Target& target) { return target.old_units.empty(); };
  if (missing && std::ranges::all_of(targets, has_none)) return tl::unexpected(*missing);
  return {};
}

// Writes the manifests of a bake of which all units are there.
Result<void> Finish(std::vector<bake::Target>& targets, const std::vector<bake::UnitReport>& reports,
                    const std::string& place) {
  for (const bake::UnitReport& report : reports) {
    targets[report.target].manifest.units.push_back(report.entry);
  }
  std::vector<archive::Manifest> manifests;
  for (bake::Target& target : targets) {
    if (auto written = archive::WriteManifest(target.place, target.manifest); !written) return written;
    manifests.push_back(target.manifest);
  }
  bake::TidyPlace(place, manifests);
  return {};
}

BakeSummary Summarize(const std::vector<bake::UnitReport>& reports, const bake::Counters& counters,
                      const std::string& place, double seconds) {
  BakeSummary summary;
  summary.place = place;
  summary.built_tiles = counters.tiles;
  summary.seconds = seconds;
  for (const bake::UnitReport& report : reports) {
    summary.tiles += report.entry.tiles;
    summary.bytes += report.entry.bytes;
    summary.baked += report.outcome == bake::UnitOutcome::kBaked;
    summary.kept += report.outcome == bake::UnitOutcome::kKept;
    summary.copied += report.outcome == bake::UnitOutcome::kCopied;
    summary.failed += report.outcome == bake::UnitOutcome::kFailed;
    summary.missing += report.outcome == bake::UnitOutcome::kMissing;
    summary.unusable += report.outcome == bake::UnitOutcome::kUnusable;
  }
  return summary;
}

void ListFailures(const std::vector<bake::UnitReport>& reports, const std::vector<bake::Target>& targets) {
  for (const bake::UnitReport& report : reports) {
    const char* const what = report.outcome == bake::UnitOutcome::kMissing    ? "is missing"
                             : report.outcome == bake::UnitOutcome::kUnusable ? "cannot be used: "
                             : report.outcome == bake::UnitOutcome::kFailed   ? "failed: "
                                                                              : nullptr;
    if (what == nullptr) continue;
    std::fprintf(stderr, "terrace: unit %s of %s %s%s\n", report.entry.name.c_str(),
                 archive::FolderOf(targets[report.target].manifest.kind.format).c_str(), what, report.message.c_str());
  }
}

// A bake whose place is claimed.
struct PlacedBake {
  const BakeArguments& arguments;
  const tiler::TilePipeline& pipeline;
  std::vector<bake::Target>& targets;
  const std::string& place;
  const bake::BakeIdentity& identity;
  const bake::UnitPlan& plan;
  const bake::BakeOptions& options;
  const bake::Shard& shard;
  const StopSignals& signals;
};

// Bakes units of a job in a queue. Returns the exit code.
int BakeJob(const PlacedBake& bake, const std::string& worker) {
  const auto finish = [&](const std::vector<bake::UnitReport>& all) {
    auto finished = Finish(bake.targets, all, bake.place);
    if (finished) bake::RemoveLocksOfJob(bake.place, bake.arguments.job, worker);
    return finished;
  };
  const Clock::time_point start = Clock::now();
  bake::Counters counters;
  std::vector<bake::UnitReport> reports;
  const int code = BakeFromQueue(
      {bake.arguments, bake.pipeline, bake.targets, bake.plan, bake.options, bake.place, worker, bake.identity, finish},
      counters, reports);
  if (bake.signals.signal() != 0) return StopCode(bake.signals);
  BakeSummary summary = Summarize(reports, counters, bake.place, SecondsSince(start));
  summary.is_complete = code == kExitOk;
  const bool has_begun = code == kExitOk || !reports.empty();
  if (code == kExitUsage || !(has_begun || bake.arguments.json)) return code;  // the reason was printed
  fmt::print("{}\n", bake.arguments.json ? SummaryJson(summary, counters) : SummaryText(summary));
  return code;
}

// Writes the manifests, and another form than chunks. Returns an exit code.
int FinishAlone(const PlacedBake& bake, const std::vector<bake::UnitReport>& reports, BakeSummary& summary) {
  if (const auto finished = Finish(bake.targets, reports, bake.place); !finished) {
    return Fail(finished.error());
  }
  summary.is_complete = true;
  if (bake.arguments.form == kChunks) return kExitOk;
  summary.place = bake.arguments.out;
  const auto exported = Export(bake.arguments, bake.place, bake.identity, bake.pipeline.datasets().front().generation,
                               bake.signals.token());
  if (exported) return kExitOk;
  return bake.signals.signal() != 0 ? StopCode(bake.signals) : Fail(exported.error());
}

// Bakes the units of the shard, or all. Returns the exit code.
int BakeAlone(const PlacedBake& bake) {
  const Clock::time_point start = Clock::now();
  bake::Counters counters;
  std::vector<bake::UnitReport> reports;
  {
    const BakeDisplay display(bake.pipeline.datasets().front().name, bake.plan.tiles, bake.plan.files, counters);
    reports = bake::Bake(bake.pipeline, bake.targets, bake.plan, bake.options, counters);
  }
  BakeSummary summary = Summarize(reports, counters, bake.place, SecondsSince(start));
  const std::uint64_t done = summary.baked + summary.kept + summary.copied;
  if (bake.signals.signal() != 0) {
    std::fprintf(stderr, "terrace: stopped: %s of %s files are done; run the same command again to go on\n",
                 Grouped(done).c_str(), Grouped(bake.plan.files).c_str());
    return StopCode(bake.signals);
  }
  ListFailures(reports, bake.targets);
  const bool is_whole = done == bake.plan.files;
  if (is_whole && bake.shard.count == 1) {
    if (const int code = FinishAlone(bake, reports, summary); code != kExitOk) return code;
  }
  fmt::print("{}\n", bake.arguments.json ? SummaryJson(summary, counters) : SummaryText(summary));
  if (!is_whole) {
    std::fprintf(
        stderr, "terrace: the bake is not complete: %s of %s files are not done, and no manifest was written; run %s\n",
        Grouped(bake.plan.files - done).c_str(), Grouped(bake.plan.files).c_str(),
        bake.arguments.finish ? "the same command without --finish, or the shards that they belong to, to bake them"
                              : "the same command again to go on");
    return kExitFailure;
  }
  if (bake.arguments.form == kFolder && bake.targets.front().manifest.kind.coding == tiler::Coding::kGzip) {
    std::fputs(
        "terrace: the tiles are compressed: the host must send them with Content-Encoding: gzip (docs/baking.md, \"A "
        "static host\"); for one that cannot, as python3 -m http.server, bake with --no-gzip\n",
        stderr);
  }
  if (bake.shard.count > 1) {
    std::fprintf(
        stderr,
        "terrace: shard %u of %u is done; when all are, run the same command with --finish instead of --shard\n",
        bake.shard.index, bake.shard.count);
  }
  return kExitOk;
}

// Claims the place, plans the units and bakes them. Returns the exit code.
int BakeInto(const BakeArguments& arguments, const tiler::TilePipeline& pipeline, std::vector<bake::Target> targets,
             const bake::Shard& shard, const StopSignals& signals) {
  const tiler::Dataset& dataset = pipeline.datasets().front();
  const bool is_chunked = arguments.form == kChunks;
  const std::string place = is_chunked ? arguments.out : arguments.out + ".bake";
  const bake::BakeIdentity identity = IdentityOf(arguments, dataset, targets);
  const auto is_exported = [&] { return WasExported(place, arguments, identity, dataset.generation); };
  const auto free = is_chunked ? Result<void>() : CheckExportPlace(arguments.out, arguments.form);
  if (!free && !is_exported()) return Fail(free.error());
  for (bake::Target& target : targets) {
    target.place = bake::ArchivePlace(place, target.manifest, targets.size() == 1);
    target.manifest.identity = bake::ToJson(identity);
  }
  if (const auto fits = CheckSizes(arguments, targets); !fits) return Fail(fits.error());
  const std::string worker = arguments.queue.empty() ? std::string() : WorkerName();
  std::string lock_name = shard.count > 1 ? fmt::format("{}-of-{}", shard.index, shard.count) : std::string();
  if (!worker.empty()) lock_name = bake::LockOfWorker(worker, arguments.job);
  const auto lock = bake::PlaceLock::Take(place, lock_name);
  if (signals.signal() != 0) return StopCode(signals);  // a store that does not answer holds it up
  if (!lock) return Fail(lock.error());
  if (!free) {
    if (!is_exported()) return Fail(free.error());  // another process was here before the lock
    RemoveBake(place);
    std::fprintf(stderr, "terrace: %s: is complete already\n", arguments.out.c_str());
    return kExitOk;
  }
  if (const auto claimed = bake::ClaimPlace(place, identity, dataset.generation, !is_chunked); !claimed) {
    return signals.signal() != 0 ? StopCode(signals) : Fail(claimed.error());
  }
  if (!worker.empty() && IsFinished(place, targets)) return kExitOk;
  if (!arguments.update.empty()) {
    if (const auto read = ReadOld(arguments.update, targets); !read) return Fail(read.error());
  }
  const bake::UnitPlan plan = bake::UnitPlan::Make(targets, shard);
  bake::BakeOptions options;
  options.threads = ThreadsOf(arguments);
  options.only_verify = arguments.finish;
  options.stop = signals.token();
  if (arguments.json) {
    options.on_unit = [&targets](const bake::UnitReport& report) {
      fmt::print("{}\n", UnitJson(report, targets));
      std::fflush(stdout);
    };
  }
  const PlacedBake bake{arguments, pipeline, targets, place, identity, plan, options, shard, signals};
  return worker.empty() ? BakeAlone(bake) : BakeJob(bake, worker);
}

// 10^9 tiles are the planet at 30 m a few times over: more is likely a mistake.
constexpr std::uint64_t kManyTiles = 1'000'000'000;

// What cannot be a place of a bake; empty: it can.
std::string WrongPlace(const std::string& out) {
  const std::size_t scheme_end = out.find("://");
  const std::string scheme = out.substr(0, scheme_end);
  if (scheme_end != std::string::npos && scheme.find('/') == std::string::npos) {
    return fmt::format("--out {}: URLs are not accepted; name a bucket as /vsis3/BUCKET/FOLDER{}", out,
                       scheme == "s3" ? fmt::format(", here /vsis3/{}", out.substr(scheme_end + 3)) : "");
  }
  if (!dem::IsGdalName(out) || archive::IsBucket(out)) return {};
  return "--out: a bake is written into a folder, or into a bucket such as /vsis3/BUCKET/FOLDER";
}

// Above the deepest level of the sources --error is a lower limit, and has no effect if the errors of all levels exceed
// it.
void WarnAboutUnusedError(const BakeArguments& arguments, const tiler::Dataset& dataset,
                          const std::vector<archive::Manifest>& manifests) {
  const auto mesh = std::ranges::find_if(manifests, [](const archive::Manifest& manifest) {
    return manifest.kind.format != tiler::TileFormat::kHeightPng;
  });
  if (arguments.error <= 0 || mesh == manifests.end()) return;
  const int last = static_cast<int>(mesh->available.size()) - 1;
  const int deepest = dataset.model->max_source_level();
  const double default_error = dataset.error_fraction * geo::LevelError(last);
  if (last >= deepest || arguments.error >= default_error) return;
  std::fprintf(
      stderr,
      "terrace: --error %s has no effect: it is below the default error of all levels, %.3g m at level %d and more "
      "above it, and only level %d, the deepest of the sources, may be finer; --fraction changes all levels\n",
      PlainNumber(arguments.error).c_str(), default_error, last, deepest);
}

// Combinations that make no sense; empty: none.
std::string WrongTogether(const BakeArguments& arguments) {
  const auto given = [](const std::string& text) { return !text.empty(); };
  if (given(arguments.cell_list)) {
    if (!arguments.dry_run) return "--catalogue plans without sources: give --dry-run with it";
    if (!arguments.dems.empty() || given(arguments.config)) return "--catalogue stands for the sources; give no DEM";
    if (arguments.format != "terrain" || arguments.form != kChunks || arguments.no_gzip || arguments.finish ||
        arguments.error > 0 || arguments.fraction > 0 || given(arguments.out) || given(arguments.update) ||
        given(arguments.into_cache) || given(arguments.codings) || given(arguments.extensions) ||
        given(arguments.shard) || given(arguments.queue) || given(arguments.job) ||
        given(arguments.queue_password_file) || given(arguments.queue_ca) || arguments.threads > 0 || arguments.yes ||
        !arguments.dataset_flags.empty() || !arguments.cache_flags.empty()) {
      return "--catalogue plans all terrain tiles at the default error: it takes --levels, --bbox, --arc-seconds, "
             "--bytes-per-tile, --ms-per-tile and --json, and no other option";
    }
    return {};
  }
  if (arguments.has_assumptions) {
    return "--arc-seconds, --bytes-per-tile and --ms-per-tile are assumptions for --catalogue; for sources these "
           "numbers are measured";
  }
  if (!arguments.dems.empty() && given(arguments.dataset) && arguments.dataset_flags.contains("name")) {
    return "--dataset and --name both name the DEM's dataset; give one";
  }
  if (arguments.dems.empty() == arguments.config.empty()) {
    return arguments.dems.empty()
               ? "there is nothing to bake; name a DEM ('terrace bake dem.tif --out PLACE') or --config"
               : "give DEMs, or a configuration with --config, not both";
  }
  if (given(arguments.into_cache)) {
    if (given(arguments.out) || given(arguments.update) || given(arguments.queue) || given(arguments.job) ||
        arguments.finish || arguments.form != kChunks || arguments.no_gzip) {
      return "--into-cache fills a cache instead of a place: leave out --out, --form, --update, --queue, --job, "
             "--finish and --no-gzip";
    }
    if (dem::IsGdalName(arguments.into_cache)) return "--into-cache: a disk cache is a folder of this machine";
    return {};
  }
  if (given(arguments.codings)) return "--codings is for --into-cache";
  if (const std::string wrong = WrongPlace(arguments.out); !wrong.empty()) return wrong;
  if (!arguments.dry_run && !given(arguments.out)) return "--out PLACE is missing: where the bake goes";
  if (archive::IsBucket(arguments.out) && arguments.form != kChunks) {
    return fmt::format(
        "--form {} is written into a folder of this machine; copy it to the bucket when it is complete, "
        "or bake chunks there",
        arguments.form);
  }
  if (given(arguments.queue) != given(arguments.job)) return "--queue and --job belong together: give both";
  if (given(arguments.queue) && (given(arguments.shard) || arguments.finish)) {
    return "--queue hands out the units and finishes the bake: leave --shard and --finish out";
  }
  if ((given(arguments.queue_password_file) || given(arguments.queue_ca)) && !given(arguments.queue)) {
    return "--queue-password-file and --queue-ca are for --queue";
  }
  if (given(arguments.shard) && arguments.finish) return "--finish is for all shards together: leave --shard out";
  if ((given(arguments.shard) || arguments.finish || given(arguments.queue)) && arguments.form != kChunks) {
    return fmt::format("--form {} needs all units in one run; with --shard, --finish or --queue use --form chunks",
                       arguments.form);
  }
  if (given(arguments.update)) {
    std::error_code ignored;
    if (std::filesystem::equivalent(arguments.update, arguments.out, ignored) || arguments.update == arguments.out) {
      return "--update and --out name the same place: a finished bake is not changed, give a new one with --out";
    }
  }
  return {};
}

}  // namespace

int Bake(const BakeArguments& given) {
  BakeArguments arguments = given;
  for (std::string* const place : {&arguments.out, &arguments.update}) {  // "a//b" is another object than "a/b"
    while (archive::IsBucket(*place) && place->ends_with('/')) place->pop_back();
  }
  tiler::BuildId();  // before GDAL loads further libraries, as the server takes it: it is part of the keys of a cache
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);  // writing beyond a file size limit fails, as on a full disk
  const StopSignals signals;
  spdlog::set_default_logger(spdlog::stderr_logger_mt("terrace"));  // stdout is for --json
  spdlog::set_level(spdlog::level::warn);
  if (const std::string wrong = WrongTogether(arguments); !wrong.empty()) {
    return cli::Fail(wrong + "\nRun 'terrace bake --help' for what is accepted.", kExitUsage);
  }
  const auto request = BakeRequestOf(arguments);
  if (!request) return Fail(request.error());
  const auto codings = CodingsOf(arguments.codings);
  if (!codings) return Fail(codings.error());
  const auto shard = ShardOf(arguments.shard);
  if (!shard) return Fail(shard.error());
  if (!arguments.cell_list.empty()) return PlanFromCells(arguments, *request);

  std::vector<config::ConfigError> errors;
  const auto input = InputOf(arguments, errors);
  if (!errors.empty()) return Fail(errors);
  if (!input) return Fail(input.error());
  auto dataset = OpenDataset(arguments, *input, signals);
  if (signals.signal() != 0) return StopCode(signals);
  if (!dataset) return cli::Fail(dataset.error().message, kExitFailure);
  const auto manifests = bake::PlanArchives(*dataset, *request, "terrace " TERRACE_VERSION);
  if (!manifests) return Fail(manifests.error());
  std::vector<bake::Target> targets;
  std::uint64_t tiles = 0;
  const bool is_seed = !arguments.into_cache.empty();
  for (const archive::Manifest& manifest : is_seed ? InCodings(*manifests, *codings) : *manifests) {
    targets.push_back({{}, manifest});
    tiles += bake::CountTiles(manifest.available);
  }
  WarnAboutUnusedError(arguments, *dataset, *manifests);
  // A tile's refinement is needed only by the tile's other formats.
  constexpr std::size_t kRefinementBytes = std::size_t{64} << 20;
  const tiler::TilePipeline pipeline({*std::move(dataset)}, targets.size() > 1 ? kRefinementBytes : 0);
  if (arguments.dry_run) {
    const auto estimate = bake::EstimateBake(pipeline, targets, bake::UnitPlan::Make(targets, *shard), signals.token());
    if (signals.signal() != 0) return StopCode(signals);
    if (!estimate) return Fail(estimate.error());
    fmt::print("{}", arguments.json ? EstimateJson(*estimate) + "\n" : EstimateText(*estimate));
    return kExitOk;
  }
  if (tiles > kManyTiles && !arguments.yes) {
    return cli::Fail(fmt::format("{} tiles would be baked; add --yes if that is meant, or limit --levels or --bbox "
                                 "(--dry-run tells what it takes)",
                                 Grouped(tiles)),
                     kExitUsage);
  }
  if (is_seed) return SeedCache(arguments, input->config.disk_cache, pipeline, std::move(targets), *shard, signals);
  return BakeInto(arguments, pipeline, std::move(targets), *shard, signals);
}

}  // namespace terrace::cli
