// terrace: one binary with subcommands.
#include <fcntl.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdio>
#include <exception>
#include <new>
#include <string>
#include <utility>
#include <vector>

#include "engine/gdal/source_policy.h"
#include "server/cli/common/command.h"
#include "server/cli/common/help_format.h"
#include "server/cli/common/usage_error.h"

namespace terrace::cli {
namespace {

int ReportUsage(const CLI::App& program, const CLI::ParseError& error, const std::vector<std::string>& arguments) {
  std::string name;  // "bake status "
  for (const CLI::App* app = &program; !app->get_subcommands().empty();) {
    app = app->get_subcommands().front();
    name += app->get_name() + ' ';
  }
  std::fprintf(stderr, "terrace: %s\nRun 'terrace %s--help' for what is accepted.\n",
               ExplainUsage(program, error, arguments).c_str(), name.c_str());
  return kExitUsage;
}

int Run(int argc, char** argv) {
  CLI::App app{"Terrain from elevation models, meshed on demand at the error a client asks for.", "terrace"};
  SetHelpFormat(app);
  app.footer(
      "'terrace COMMAND --help' lists the options of a command.\n\n"
      "Examples:\n"
      "  terrace serve alps.tif                               tiles and a viewer at http://127.0.0.1:8080/\n"
      "  terrace mesh alps.tif --out alps.obj --max-error 5   one mesh of the whole raster\n"
      "  terrace info alps.tif                                the raster, and the levels that it can serve\n"
      "  terrace bake alps.tif --out alps                     all tiles, ahead of requests\n"
      "  terrace fly URL --circle 7.7,46,5000,20000           a client that flies over a served dataset");
  app.set_version_flag("--version", "terrace " TERRACE_VERSION);
  app.require_subcommand(1);
  int exit_code = kExitOk;
  AddServe(app, exit_code);
  AddMesh(app, exit_code);
  AddInfo(app, exit_code);
  AddBake(app, exit_code);
  AddFly(app, exit_code);
  if (argc == 1) {
    std::fputs(app.help().c_str(), stderr);
    return kExitUsage;
  }
  std::vector<std::string> arguments(argv + 1, argv + argc);
  if (arguments.front() == "help") {  // terrace help COMMAND
    arguments.erase(arguments.begin());
    arguments.emplace_back("--help");
  }
  if (const std::string missing = ExplainMissingValue(app, arguments); !missing.empty())
    return Fail(missing, kExitUsage);
  std::vector<std::string> reversed(arguments.rbegin(), arguments.rend());  // CLI11 expects them in reverse order
  try {
    app.parse(std::move(reversed));
  } catch (const CLI::ParseError& error) {
    const bool is_help = error.get_exit_code() == 0;  // or --version
    if (is_help && !HasUnknownCommand(app, arguments)) return FinishOutput(app.exit(error));
    return ReportUsage(app, error, arguments);
  }
  return exit_code;
}

// The kernel drops signals of the first process of a container that have no handler.
void EndFirstProcess(int signal) { ::_exit(128 + signal); }

}  // namespace
}  // namespace terrace::cli

int main(int argc, char** argv) {
  // If a standard stream is closed, the next opened file would take its descriptor and receive its output.
  while (true) {
    const int opened = ::open("/dev/null", O_RDWR);
    if (opened > STDERR_FILENO) ::close(opened);
    if (opened < 0 || opened > STDERR_FILENO) break;
  }
  try {
    for (const int signal : {SIGINT, SIGTERM}) {
      if (::getpid() == 1) std::signal(signal, terrace::cli::EndFirstProcess);
    }
    std::signal(SIGXFSZ, SIG_IGN);  // writing beyond a file size limit fails, as on a full disk
    // Before there are threads.
    terrace::dem::ClearGdalEnvironment();
    return terrace::cli::Run(argc, argv);
  } catch (const std::bad_alloc&) {
    std::fputs(
        "terrace: there is not enough memory for this; free some, raise the limit (ulimit -v, MemoryMax= of "
        "systemd), or ask for less: a larger --max-error, a smaller --bbox, fewer --threads\n",
        stderr);
    return terrace::cli::kExitFailure;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "terrace: %s\n", error.what());
    return terrace::cli::kExitFailure;
  }
}
