// terrace bake: builds all tiles of a dataset ahead of requests.
#include <CLI/CLI.hpp>
#include <memory>
#include <string>
#include <vector>

#include "config/options/options.h"
#include "server/cli/bake/bake_arguments.h"
#include "server/cli/bake/bake_run.h"
#include "server/cli/bake/bake_status.h"
#include "server/cli/common/command.h"
#include "server/cli/common/option_checks.h"
#include "server/cli/common/option_flags.h"

namespace terrace::cli {
namespace {

constexpr const char* kWhat = "What is baked";
constexpr const char* kHow = "How it is baked";
constexpr const char* kPlanning = "Planning";

void AddWhat(CLI::App& command, BakeArguments& arguments) {
  command.add_option("DEM", arguments.dems,
                     "Rasters that GDAL can read, or folders of them; together they are one dataset, and where they "
                     "overlap, the first that has a height counts");
  command.add_option("--config", arguments.config, "A configuration as for terrace serve, instead of DEMs")
      ->type_name("FILE");
  command.add_option("--dataset", arguments.dataset, "The dataset of the configuration that is baked")
      ->type_name("NAME");
  command
      .add_option(
          "-o,--out", arguments.out,
          "Where the bake goes: a folder, a bucket such as /vsis3/BUCKET/FOLDER, or for --form single and 3tz a file")
      ->type_name("PLACE");
  command
      .add_option("--into-cache", arguments.into_cache,
                  "Instead of --out: the disk_cache of a server, which then answers these tiles from disk; the server "
                  "must not run meanwhile")
      ->type_name("DIR");
  command
      .add_option(
          "--form", arguments.form,
          "chunks: files of a few thousand tiles, for terrace serve and updates; folder: one file for each tile, for "
          "static hosts; single: one PMTiles file; 3tz: one file of 3D Tiles")
      ->check(OneOf({kChunks, kFolder, kSingle, k3tz}))
      ->type_name("chunks|folder|single|3tz")
      ->capture_default_str()
      ->group(kWhat);
  command.add_option("--format", arguments.format, "terrain, glb or png; several with commas share the work")
      ->type_name("FORMAT")
      ->capture_default_str()
      ->group(kWhat);
  command
      .add_flag("--no-gzip", arguments.no_gzip,
                "Does not compress tiles, for static hosts that cannot send Content-Encoding")
      ->group(kWhat);
  command.add_option("--levels", arguments.levels, "The first and the last level; by default all")
      ->type_name("A-B")
      ->group(kWhat);
  command.add_option("--bbox", arguments.bbox, "Only tiles that overlap this area, in degrees, and their siblings")
      ->type_name("W,S,E,N")
      ->group(kWhat);
  command
      .add_option("--error", arguments.error,
                  "The error of deep levels; shallow levels keep their larger default (?error=M&atleast=1)")
      ->check(NumberAbove0("a number of metres above 0"))
      ->type_name("METRES")
      ->group(kWhat);
  command
      .add_option("--fraction", arguments.fraction, "The error of every level, as a share of what clients assume there")
      ->check(NumberAbove0("a number above 0"))
      ->type_name("SHARE")
      ->group(kWhat);
  command
      .add_option("--extensions", arguments.extensions,
                  "Of terrain tiles: octvertexnormals, watermask, metadata, several with commas, or none; by default "
                  "normals, and the water mask where the dataset has one")
      ->type_name("NAMES")
      ->group(kWhat);
}

void AddQueueSecrets(CLI::App& command, BakeArguments& arguments, const char* group) {
  command
      .add_option("--queue-password-file", arguments.queue_password_file,
                  "File whose first line is the password of Redis; by default the environment variable "
                  "TERRACE_QUEUE_PASSWORD has it")
      ->type_name("FILE")
      ->group(group);
  command
      .add_option(
          "--queue-ca", arguments.queue_ca,
          "With rediss://: certificates (PEM) of the authorities that sign the server's; by default the system's")
      ->type_name("FILE")
      ->group(group);
}

void AddStatus(CLI::App& bake, int& exit_code) {
  auto arguments = std::make_shared<BakeArguments>();
  auto how = std::make_shared<StatusView>();
  CLI::App* command = bake.add_subcommand("status", "Prints the progress of a job of --queue");
  command->footer(
      "Example:\n"
      "  terrace bake status --queue redis://10.0.0.5:6379/0 --job alps --watch\n\n"
      "Exit codes: 0 the job is baking, complete or removed; 1 there is no such job, it ended incomplete, or Redis\n"
      "cannot be reached; 2 wrong arguments.");
  command->add_option("--queue", arguments->queue, "Redis of the job")->type_name("redis://HOST:PORT/DB")->required();
  command->add_option("--job", arguments->job, "The name of the job")->type_name("NAME")->required();
  AddQueueSecrets(*command, *arguments, "Options");
  command->add_flag("--json", how->json, "Prints JSON, with --watch one line each time");
  command->add_flag("--watch", how->watch, "Prints again every two seconds, until the job has ended");
  command->add_flag("--remove", how->remove, "Removes the job from Redis; the files of the bake stay");
  command->callback([arguments, how, &exit_code] { exit_code = FinishOutput(ShowStatus(*arguments, *how)); });
}

void AddHow(CLI::App& command, BakeArguments& arguments) {
  command.add_option("--threads", arguments.threads, "By default one for each processor; the files are the same")
      ->check(NumberFrom<unsigned>(1, 1024, "a number from 1 to 1024"))
      ->type_name("N")
      ->group(kHow);
  command
      .add_option("--codings", arguments.codings,
                  "With --into-cache: the content codings of the tiles, gzip, br, zstd or identity, several with "
                  "commas; by default gzip,br, which browsers ask for")
      ->type_name("NAMES")
      ->group(kHow);
  command.add_option("--shard", arguments.shard, "Bakes one of N parts, 0 to N-1, into the same place as the others")
      ->type_name("I/N")
      ->group(kHow);
  command
      .add_flag("--finish", arguments.finish, "Bakes nothing: checks all files, and writes the manifest after shards")
      ->group(kHow);
  command
      .add_option("--queue", arguments.queue,
                  "Takes the units from a queue in Redis, which several workers share; all write into the same --out. "
                  "rediss:// uses TLS")
      ->type_name("redis://HOST:PORT/DB")
      ->group(kHow);
  command.add_option("--job", arguments.job, "With --queue: the name of the job")->type_name("NAME")->group(kHow);
  AddQueueSecrets(command, arguments, kHow);
  command.add_option("--lease", arguments.lease)
      ->check(NumberAbove0("a number of seconds above 0"))
      ->group("");  // for tests: how long a worker may be silent
  command.add_option("--queue-timeout", arguments.queue_timeout)
      ->check(NumberAbove0("a number of seconds above 0"))
      ->group("");  // for tests: how long Redis may take for a reply
  command
      .add_option("--update", arguments.update,
                  "An older bake in chunks: what did not change is copied from it, the rest is baked")
      ->type_name("PLACE")
      ->group(kHow);
  command.add_flag("--json", arguments.json, "Prints one line of JSON for each file, and a summary")->group(kHow);
  command
      .add_flag("--yes", arguments.yes, "Allows a bake of more than 1,000,000,000 tiles, which is refused otherwise")
      ->group(kHow);
}

void AddPlanning(CLI::App& command, BakeArguments& arguments) {
  command
      .add_flag("--dry-run", arguments.dry_run,
                "Bakes nothing: prints levels, tiles, files, bytes and core-hours, from a few tiles that are built")
      ->group(kPlanning);
  command
      .add_option("--catalogue", arguments.cell_list,
                  "With --dry-run, instead of DEMs: a list of one-degree cells such as N46E008, one on each line")
      ->type_name("FILE")
      ->group(kPlanning);
  command
      .add_option("--arc-seconds", arguments.arc_seconds,
                  "With --catalogue: spacing of samples from south to north, in arc seconds")
      ->check(NumberAbove0("a number above 0"))
      ->capture_default_str()
      ->type_name("S")
      ->group(kPlanning);
  command
      .add_option("--bytes-per-tile", arguments.bytes_per_tile,
                  "With --catalogue: assumed mean size of a tile in bytes")
      ->check(NumberAbove0("a number above 0"))
      ->capture_default_str()
      ->type_name("N")
      ->group(kPlanning);
  command
      .add_option("--ms-per-tile", arguments.milliseconds_per_tile,
                  "With --catalogue: assumed mean time to build a tile in milliseconds")
      ->check(NumberAbove0("a number above 0"))
      ->capture_default_str()
      ->type_name("MS")
      ->group(kPlanning);
}

}  // namespace

void AddBake(CLI::App& app, int& exit_code) {
  auto arguments = std::make_shared<BakeArguments>();
  CLI::App* command = app.add_subcommand("bake", "Builds all tiles of a dataset ahead, for static hosts and archives")
                          ->group(kCommands);
  command->footer(
      "Examples:\n"
      "  terrace bake alps.tif --out alps\n"
      "  terrace bake alps.tif --out alps-static --form folder --levels 0-12\n"
      "  terrace bake --config terrace.json --dataset maui --out maui --format terrain,glb\n"
      "  terrace bake alps.tif --out alps-2 --update alps\n"
      "  terrace bake alps.tif --out /mnt/alps --queue redis://10.0.0.5:6379/0 --job alps    (on many machines)\n"
      "  terrace bake status --queue redis://10.0.0.5:6379/0 --job alps --watch\n"
      "  terrace bake --config terrace.json --dataset maui --into-cache /var/cache/terrace/tiles\n"
      "  terrace bake alps.tif --dry-run\n\n"
      "A bake that was interrupted goes on when the same command is run again: finished files are checked and\n"
      "kept. The manifest is written last.\n\n"
      "Exit codes: 0 the bake, or its shard, is complete; 1 it is not complete: files failed or are missing, or a\n"
      "source, the place or Redis cannot be used; 2 the arguments are wrong, or do not fit the place or the job;\n"
      "130 or 143 stopped by a signal.");
  AddWhat(*command, *arguments);
  AddHow(*command, *arguments);
  AddPlanning(*command, *arguments);
  std::vector<config::OptionInfo> about_dataset = config::DatasetOptionInfos();
  std::erase_if(about_dataset, [](const auto& option) { return option.key == "baked" || option.key == "public"; });
  AddFlags(*command, about_dataset, "The dataset, as for terrace serve", arguments->dataset_flags);
  std::vector<config::OptionInfo> about_cache = config::ServerOptionInfos();
  std::erase_if(about_cache, [](const auto& option) { return !option.key.starts_with("cache_dir"); });
  AddFlags(*command, about_cache, "Statistics of the rasters, as for terrace serve", arguments->cache_flags);
  AddStatus(*command, exit_code);
  command->callback([arguments, command, &exit_code] {
    if (!command->get_subcommands().empty()) return;
    while (arguments->out.size() > 1 && arguments->out.ends_with('/')) arguments->out.pop_back();
    for (const char* flag : {"--arc-seconds", "--bytes-per-tile", "--ms-per-tile"}) {
      arguments->has_assumptions |= command->count(flag) > 0;
    }
    exit_code = FinishOutput(Bake(*arguments));
  });
}

}  // namespace terrace::cli
