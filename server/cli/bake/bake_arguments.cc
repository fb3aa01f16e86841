#include "server/cli/bake/bake_arguments.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <system_error>
#include <thread>
#include <utility>

#include "config/common/working_directory.h"
#include "config/file/parse.h"
#include "config/options/options.h"
#include "engine/core/names.h"
#include "engine/geo/tile_key.h"
#include "proto/media_type.h"
#include "server/cli/common/source_files.h"

namespace terrace::cli {
namespace {

std::vector<std::string> PartsOf(const std::string& text, char separator) {
  std::vector<std::string> parts;
  std::size_t at = 0;
  while (at <= text.size()) {
    const std::size_t end = std::min(text.find(separator, at), text.size());
    parts.push_back(text.substr(at, end - at));
    at = end + 1;
  }
  return parts;
}

Result<std::vector<tiler::TileFormat>> FormatsOf(const std::string& text) {
  std::vector<tiler::TileFormat> formats;
  for (const std::string& name : PartsOf(text, ',')) {
    const auto format = ValueNamed(archive::kFormatNames, name);
    if (!format) {
      return MakeError(ErrorCode::kInvalidArgument, "--format {}: must be terrain, glb, png, or several with commas",
                       text);
    }
    if (std::ranges::find(formats, *format) != formats.end()) {
      return MakeError(ErrorCode::kInvalidArgument, "--format {}: has {} twice", text, name);
    }
    formats.push_back(*format);
  }
  return formats;
}

Result<std::pair<int, int>> LevelsOf(const std::string& text) {
  int first = 0, last = 0;
  char rest = 0;
  const bool is_range = std::sscanf(text.c_str(), "%2d-%2d%c", &first, &last, &rest) == 2;
  if (!is_range || first < 0 || first > last || last > geo::kMaxLevel) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "--levels {}: must be the first and the last level, such as 0-13, from 0 to {}", text,
                     geo::kMaxLevel);
  }
  return std::pair(first, last);
}

Result<dem::GeoBounds> BoundsOf(const std::string& text) {
  dem::GeoBounds box;
  char rest = 0;
  const bool is_box =
      std::sscanf(text.c_str(), "%lf,%lf,%lf,%lf%c", &box.west, &box.south, &box.east, &box.north, &rest) == 4;
  const auto is_in = [](double value, double most) { return std::isfinite(value) && std::abs(value) <= most; };
  const bool is_fine = is_box && is_in(box.west, 180) && is_in(box.east, 180) && is_in(box.south, 90) &&
                       is_in(box.north, 90) && box.south < box.north && box.west != box.east;
  if (!is_fine) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "--bbox {}: must be WEST,SOUTH,EAST,NORTH in degrees with south below north; west may be above "
                     "east: across the antimeridian",
                     text);
  }
  return box;
}

Result<proto::TileExtensions> ExtensionsOf(const std::string& text) {
  proto::TileExtensions extensions;
  if (text == "none") return extensions;
  for (const std::string& name : PartsOf(text, ',')) {
    const proto::TileExtensions one = proto::ParseExtensions(name);
    if (one == proto::TileExtensions()) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "--extensions {}: must be octvertexnormals, watermask, metadata, several with commas, or none",
                       text);
    }
    extensions = extensions | one;
  }
  return extensions;
}

Result<config::DatasetConfig> ConfiguredDataset(const BakeArguments& arguments, const config::Config& config) {
  std::string names;
  for (const config::DatasetConfig& dataset : config.datasets) {
    if (dataset.name == arguments.dataset) return dataset;
    names += (names.empty() ? "" : ", ") + dataset.name;
  }
  if (arguments.dataset.empty() && config.datasets.size() == 1) return config.datasets.front();
  if (arguments.dataset.empty()) {
    return MakeError(ErrorCode::kInvalidArgument, "{} has {} datasets; name one with --dataset: {}", arguments.config,
                     config.datasets.size(), names);
  }
  return MakeError(ErrorCode::kInvalidArgument, "--dataset {}: {} has no such dataset; it has {}", arguments.dataset,
                   arguments.config, names.empty() ? "none" : names);
}

}  // namespace

Result<bake::BakeRequest> BakeRequestOf(const BakeArguments& arguments) {
  bake::BakeRequest request;
  auto formats = FormatsOf(arguments.format);
  if (!formats) return tl::unexpected(formats.error());
  request.formats = *std::move(formats);
  const auto has = [&](tiler::TileFormat format) {
    return std::ranges::find(request.formats, format) != request.formats.end();
  };
  if (!arguments.levels.empty()) {
    const auto levels = LevelsOf(arguments.levels);
    if (!levels) return tl::unexpected(levels.error());
    request.levels = *levels;
  }
  if (!arguments.bbox.empty()) {
    const auto bbox = BoundsOf(arguments.bbox);
    if (!bbox) return tl::unexpected(bbox.error());
    request.bbox = *bbox;
  }
  if (!arguments.extensions.empty()) {
    if (!has(tiler::TileFormat::kQuantizedMesh)) {
      return MakeError(ErrorCode::kInvalidArgument, "--extensions is for --format terrain");
    }
    const auto extensions = ExtensionsOf(arguments.extensions);
    if (!extensions) return tl::unexpected(extensions.error());
    request.extensions = *extensions;
  }
  if (arguments.error > 0 && arguments.fraction > 0) {
    return MakeError(ErrorCode::kInvalidArgument, "--error and --fraction exclude each other; give one");
  }
  if ((arguments.error > 0 || arguments.fraction > 0) && arguments.format == "png") {
    return MakeError(ErrorCode::kInvalidArgument, "--error and --fraction are for meshes; png tiles have no error");
  }
  if (arguments.error > 0) request.requested = {arguments.error, std::nullopt, /*at_least=*/true};
  if (arguments.fraction > 0) request.requested = {std::nullopt, arguments.fraction, false};
  request.compress = !arguments.no_gzip;
  if (arguments.form != kChunks && request.formats.size() > 1) {
    return MakeError(ErrorCode::kInvalidArgument, "--form {} has one format, and --format names {}; bake each alone",
                     arguments.form, request.formats.size());
  }
  if (arguments.form == k3tz && !has(tiler::TileFormat::kGlb)) {
    return MakeError(ErrorCode::kInvalidArgument, "--form 3tz holds 3D Tiles: give --format glb");
  }
  return request;
}

Result<std::vector<tiler::Coding>> CodingsOf(const std::string& text) {
  if (text.empty()) return std::vector{tiler::Coding::kGzip, tiler::Coding::kBrotli};
  std::vector<tiler::Coding> codings;
  for (const std::string& name : PartsOf(text, ',')) {
    const auto* const known = std::ranges::find(tiler::kCodings, name, tiler::NameOf);
    if (known == tiler::kCodings.end() && name != "identity") {
      return MakeError(ErrorCode::kInvalidArgument,
                       "--codings {}: must be gzip, br, zstd, identity, or several with commas", text);
    }
    codings.push_back(name == "identity" ? tiler::Coding::kIdentity : *known);
    if (std::ranges::count(codings, codings.back()) > 1) {
      return MakeError(ErrorCode::kInvalidArgument, "--codings {}: has {} twice", text, name);
    }
  }
  return codings;
}

Result<bake::Shard> ShardOf(const std::string& text) {
  bake::Shard shard;
  if (text.empty()) return shard;
  constexpr unsigned kMaxShards = 1'000'000;
  char rest = 0;
  const bool is_shard = std::sscanf(text.c_str(), "%7u/%7u%c", &shard.index, &shard.count, &rest) == 2;
  if (!is_shard || shard.count < 1 || shard.count > kMaxShards || shard.index >= shard.count) {
    return MakeError(ErrorCode::kInvalidArgument, "--shard {}: must be I/N with I from 0 to N-1, such as 0/8", text);
  }
  return shard;
}

unsigned ThreadsOf(const BakeArguments& arguments) {
  return arguments.threads > 0 ? arguments.threads : std::max(std::thread::hardware_concurrency(), 1U);
}

Result<BakeInput> InputOf(const BakeArguments& arguments, std::vector<config::ConfigError>& errors) {
  BakeInput input;
  std::error_code unnamed;
  const std::filesystem::path directory = std::filesystem::current_path(unnamed);
  if (!arguments.config.empty()) {
    config::ConfigResult loaded = config::LoadConfig(config::FromWorkingDirectory(directory, arguments.config));
    if (!loaded) {
      errors = std::move(loaded).error();
      for (config::ConfigError& error : errors) {
        error = {"", fmt::format("{}: {}", arguments.config, error.Text())};
      }
      return MakeError(ErrorCode::kInvalidArgument, "configuration {}", arguments.config);
    }
    input.config = *std::move(loaded);
  }
  for (const auto& [key, text] : arguments.cache_flags) {
    config::SetServerOption(key, text, directory, input.config, errors);
  }
  for (const auto& [key, text] : arguments.dataset_flags) {
    if (!arguments.config.empty()) {
      errors.push_back({config::FlagOf(key), "is for DEMs of the command line; write it into the configuration"});
      continue;
    }
    config::SetDatasetOption(key, text, directory, input.dataset, errors);
  }
  if (!errors.empty()) return MakeError(ErrorCode::kInvalidArgument, "the command");
  if (!arguments.config.empty()) {
    auto dataset = ConfiguredDataset(arguments, input.config);
    if (!dataset) return tl::unexpected(dataset.error());
    input.dataset = *std::move(dataset);
    input.dataset.baked.clear();  // a bake comes from sources
    if (input.dataset.sources.empty()) {
      return MakeError(ErrorCode::kInvalidArgument, "dataset {} has no sources, only the archive of an earlier bake",
                       input.dataset.name);
    }
    return input;
  }
  for (const std::string& written : arguments.dems) {
    if (written.ends_with(".json")) {
      return MakeError(ErrorCode::kInvalidArgument, "{} looks like a configuration: terrace bake --config {}", written,
                       written);
    }
    Result<config::SourceConfig> source = config::SourceAt(config::FromWorkingDirectory(directory, written));
    if (!source) return tl::unexpected(source.error());
    input.dataset.sources.push_back(*std::move(source));
  }
  if (!arguments.dataset.empty()) {
    config::SetDatasetOption("name", arguments.dataset, directory, input.dataset, errors);
    if (!errors.empty()) return MakeError(ErrorCode::kInvalidArgument, "the command");
  }
  if (input.dataset.name.empty()) input.dataset.name = DatasetNameOf(arguments.dems.front());
  return input;
}

}  // namespace terrace::cli
