// The arguments of `terrace bake`, and what they mean.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "bake/bake_request.h"
#include "bake/baker.h"
#include "config/config.h"
#include "engine/core/result.h"
#include "tiler/tile/coding.h"

namespace terrace::cli {

inline constexpr const char* kChunks = "chunks";
inline constexpr const char* kFolder = "folder";
inline constexpr const char* kSingle = "single";
inline constexpr const char* k3tz = "3tz";

struct BakeArguments {
  std::vector<std::string> dems;
  std::string config, dataset;
  std::string out, form = kChunks, update;
  std::string into_cache, codings;
  std::string format = "terrain", levels, bbox, extensions;  // as written; empty: not given
  double error = 0, fraction = 0;                            // 0: not given
  unsigned threads = 0;                                      // 0: one for each processor
  std::string shard;
  std::string queue, job, queue_password_file, queue_ca;  // empty: not given
  double lease = 30, queue_timeout = 10;                  // seconds
  bool finish = false, dry_run = false, json = false, yes = false, no_gzip = false;
  std::string cell_list;  // file (bake/cell_list.h); empty: not given
  double arc_seconds = 1, bytes_per_tile = 2000, milliseconds_per_tile = 2;
  bool has_assumptions = false;                                   // whether one of these three is given
  std::map<std::string, std::string> dataset_flags, cache_flags;  // by option key
};

// Check everything that needs no source. kInvalidArgument: the message names the flag and valid values.
Result<bake::BakeRequest> BakeRequestOf(const BakeArguments& arguments);
Result<bake::Shard> ShardOf(const std::string& text);
Result<std::vector<tiler::Coding>> CodingsOf(const std::string& text);

// The number of threads to use.
unsigned ThreadsOf(const BakeArguments& arguments);

// The dataset, and the configuration of the program: from a file, or for DEMs that form one dataset.
struct BakeInput {
  config::Config config;
  config::DatasetConfig dataset;
};
// `errors`: all errors of the configuration are appended.
Result<BakeInput> InputOf(const BakeArguments& arguments, std::vector<config::ConfigError>& errors);

}  // namespace terrace::cli
