// terrace: one binary, one subcommand per job.
#include <fcntl.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "config/common/nearest_name.h"
#include "engine/dem/gdal/source_policy.h"
#include "server/cli/common/command.h"

namespace terrace::cli {
namespace {

std::string DidYouMean(std::string_view word, const std::vector<std::string>& known) {
  const std::vector<std::string_view> candidates(known.begin(), known.end());
  const std::string_view nearest = config::NearestName(word, candidates);
  return nearest.empty() ? std::string() : "; did you mean " + std::string(nearest) + "?";
}

std::vector<std::string> CommandNames(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* command : app.get_subcommands({})) names.push_back(command->get_name());
  return names;
}

std::vector<std::string> FlagNames(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options()) {
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  }
  return names;
}

// What is wrong with the arguments that `error` stands for. `app` is the chosen command, or the program without one.
std::string Explain(const CLI::App& app, const CLI::ParseError& error, const std::vector<std::string>& arguments) {
  if (dynamic_cast<const CLI::RequiredError*>(&error) != nullptr && !CommandNames(app).empty()) {
    const std::string& word = arguments.front();
    if (word.starts_with('-')) return "unknown option " + word + DidYouMean(word, FlagNames(app));
    return "unknown command " + word + DidYouMean(word, CommandNames(app));
  }
  // A mistyped option often lacks as well: say what was typed, not what is missing.
  for (const std::string& word : app.remaining(/*recurse=*/true)) {
    if (!word.starts_with("--")) continue;
    const std::string flag = word.substr(0, word.find('='));
    return "unknown option " + flag + DidYouMean(flag, FlagNames(app));
  }
  const std::string what = error.what();
  // "Could not convert: --flag = value": a secret may stand there by mistake.
  if (dynamic_cast<const CLI::ConversionError*>(&error) != nullptr) return what.substr(0, what.find(" = "));
  return what;
}

int ReportUsage(const CLI::App& app, const CLI::ParseError& error, const std::vector<std::string>& arguments) {
  const std::vector<CLI::App*> chosen = app.get_subcommands();
  const CLI::App& command = chosen.empty() ? app : *chosen.front();
  const std::string name = chosen.empty() ? "" : command.get_name() + ' ';
  std::fprintf(stderr, "terrace: %s\nRun 'terrace %s--help' for what is accepted.\n",
               Explain(command, error, arguments).c_str(), name.c_str());
  return kExitUsage;
}

int Run(int argc, char** argv) {
  CLI::App app{"Terrain from elevation models, meshed on demand at the error a client asks for.", "terrace"};
  app.footer(
      "Examples:\n"
      "  terrace serve alps.tif                               tiles and a viewer at http://127.0.0.1:8080/\n"
      "  terrace mesh alps.tif --out alps.obj --max-error 5   one mesh of the whole raster\n"
      "  terrace info alps.tif                                what a raster holds and how deep it can be served");
  app.set_version_flag("--version", "terrace " TERRACE_VERSION);
  app.require_subcommand(1);
  int exit_code = kExitOk;
  AddServe(app, exit_code);
  AddMesh(app, exit_code);
  AddInfo(app, exit_code);
  if (argc == 1) {
    std::fputs(app.help().c_str(), stderr);
    return kExitUsage;
  }
  std::vector<std::string> arguments(argv + 1, argv + argc);
  if (arguments.front() == "help") {  // terrace help COMMAND
    arguments.erase(arguments.begin());
    arguments.emplace_back("--help");
  }
  std::vector<std::string> reversed(arguments.rbegin(), arguments.rend());  // CLI11 takes them from the back
  try {
    app.parse(std::move(reversed));
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);  // --help, --version
    return ReportUsage(app, error, arguments);
  }
  return exit_code;
}

}  // namespace
}  // namespace terrace::cli

int main(int argc, char** argv) {
  // Where a standard stream is closed, the next file that is opened would be one, and get what is meant for it.
  while (true) {
    const int opened = ::open("/dev/null", O_RDWR);
    if (opened > STDERR_FILENO) ::close(opened);
    if (opened < 0 || opened > STDERR_FILENO) break;
  }
  try {
    // Before there are threads.
    terrace::dem::ClearGdalEnvironment();
    return terrace::cli::Run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "terrace: %s\n", error.what());
    return terrace::cli::kExitFailure;
  }
}
