// terrace fly: a client that flies over a served dataset, and reports how it was served.
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <system_error>
#include <vector>

#include "engine/core/errno_text.h"
#include "engine/core/result.h"
#include "fly/flight/flight.h"
#include "fly/report/html_report.h"
#include "fly/report/requirement.h"
#include "fly/report/summary.h"
#include "server/cli/common/command.h"
#include "server/cli/common/replaced_file.h"
#include "server/cli/fly/fly_arguments.h"

namespace terrace::cli {
namespace {

std::atomic<bool> stop_requested = false;

extern "C" void RequestStop(int /*signal*/) { stop_requested = true; }

bool IsPipeOrDevice(const std::string& path) {
  std::error_code ignored;
  return std::filesystem::exists(path, ignored) && !std::filesystem::is_regular_file(path, ignored) &&
         !std::filesystem::is_directory(path, ignored);
}

// Replaces a file; pipes and devices get the text.
Result<void> WriteFile(const std::string& path, const std::string& text) {
  if (IsPipeOrDevice(path)) {
    std::ofstream pipe(path, std::ios::binary);
    pipe << text << std::flush;
    return pipe ? Result<void>() : MakeError(ErrorCode::kUnavailable, "cannot write {}: {}", path, ErrorText());
  }
  Result<ReplacedFile> file = ReplacedFile::Open(path);
  if (!file) return tl::unexpected(file.error());
  file->stream() << text;
  return file->Commit();
}

// Called before a flight, which may take hours.
Result<void> CheckWritable(const std::string& path, const std::string& read) {
  if (path.empty()) return {};
  std::error_code ignored;
  if (std::filesystem::equivalent(path, read, ignored)) {
    return MakeError(ErrorCode::kInvalidArgument, "{} is the file of --path; give another name", path);
  }
  // Opening and closing a pipe here would end its reader.
  if (IsPipeOrDevice(path)) {
    if (::access(path.c_str(), W_OK) == 0) return {};
    return MakeError(ErrorCode::kUnavailable, "cannot write {}: {}; name a file in a folder that is writable", path,
                     ErrorText());
  }
  const Result<ReplacedFile> tried = ReplacedFile::Open(path);
  return tried ? Result<void>() : tl::unexpected(tried.error());
}

int RunFly(const FlyArguments& arguments) {
  const Result<fly::FlightOptions> options = OptionsOf(arguments);
  if (!options) return Fail(options.error().message, kExitUsage);
  const Result<std::vector<fly::Requirement>> requirements = fly::ParseRequirements(arguments.require);
  if (!requirements) return Fail(requirements.error().message, kExitUsage);
  std::error_code ignored;
  if (!arguments.report.empty() && !arguments.urls.empty() &&
      std::filesystem::weakly_canonical(arguments.report, ignored) ==
          std::filesystem::weakly_canonical(arguments.urls, ignored)) {
    return Fail("--report and --urls name the same file; give two", kExitUsage);
  }
  for (const std::string& path : {arguments.report, arguments.urls}) {
    if (const Result<void> writable = CheckWritable(path, arguments.path); !writable) {
      return Fail(writable.error());
    }
  }
  const auto interrupt_before = std::signal(SIGINT, RequestStop), terminate_before = std::signal(SIGTERM, RequestStop);
  fly::Statistics statistics(options->clients);
  std::FILE* const log = arguments.json ? stderr : stdout;
  fmt::print(log, "{}: {:.1f} km in {:.0f} s, {} client{}\n", options->document.PublicText(),
             options->path.length_m() / 1000, options->duration_s, options->clients, options->clients == 1 ? "" : "s");
  fly::Fly(
      *options, stop_requested,
      [&](std::size_t i) {
        fmt::print(log, "{}\n", fly::LineOf(i, statistics.second(i)));
        std::fflush(log);
      },
      statistics);

  // The reports may wait for the reader of a pipe.
  std::signal(SIGINT, interrupt_before);
  std::signal(SIGTERM, terminate_before);
  const fly::FlightRecord record = statistics.record();
  const fly::Summary summary = fly::Summarize(*options, record);
  const fly::Judgements judgements = fly::Judge(*requirements, summary);
  bool written = true;
  const auto write = [&](const std::string& path, const std::string& text) {
    const Result<void> done = WriteFile(path, text);
    if (done) return;
    Fail(done.error());
    written = false;
  };
  if (!arguments.report.empty()) write(arguments.report, fly::HtmlOf(*options, summary, judgements, record));
  if (!arguments.urls.empty()) {
    std::string lines;
    for (const std::string& url : record.urls) lines += url + "\n";
    write(arguments.urls, lines);
  }
  if (arguments.json) {
    fmt::print("{}", fly::JsonOf(*options, summary, judgements, record.seconds));
  } else {
    fmt::print("\n{}", fly::TextOf(summary));
    for (const fly::Judgement& judgement : judgements.all) {
      fmt::print("{} {}: {}\n", judgement.holds ? "holds " : "FAILS ", judgement.requirement.text, judgement.shown);
    }
  }
  const bool has_flown = summary.totals.tiles > 0 && summary.never_opened == 0 && !summary.is_beside_data;
  return FinishOutput(has_flown && written && judgements.AllHold() ? kExitOk : kExitFailure);
}

}  // namespace

void AddFly(CLI::App& app, int& exit_code) {
  auto arguments = std::make_shared<FlyArguments>();
  CLI::App* fly = app.add_subcommand("fly", "Flies over a served dataset as a client, and reports what it saw");
  fly->group(kCommands);
  fly->footer(
      "Loads the tiles that cesium-native would load on this path, in real time, and prints a line each second.\n"
      "Exit status 1: a requirement of --require failed, or no terrain of the dataset could be seen.\n"
      "docs/flying.md explains each number.\n\n"
      "Examples:\n"
      "  terrace fly http://127.0.0.1:8080/maui --circle -156.3,20.75,4500,20000 --report maui.html\n"
      "  terrace fly http://127.0.0.1:8080/alps --from 7.6,45.9,5000 --to 8.1,46.6,5000 --format 3dtiles\n"
      "  terrace fly https://tiles.example.org/alps --path path.csv --clients 20 --require "
      "full-view=2s,p99=50ms,holes=0");
  AddFlags(*fly, *arguments);
  fly->callback([arguments, &exit_code] { exit_code = RunFly(*arguments); });
}

}  // namespace terrace::cli
