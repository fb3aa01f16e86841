// terrace: one binary, one subcommand per job.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>

#include "server/cli/command.h"

namespace terrace::cli {
namespace {

int Run(int argc, char** argv) {
  CLI::App app{"Terrain from elevation models, meshed on demand at the error a client asks for.", "terrace"};
  app.footer(
      "  terrace serve alps.tif                               tiles and a viewer at http://127.0.0.1:8080/\n"
      "  terrace mesh alps.tif --out alps.obj --max-error 5   one mesh of the whole raster\n"
      "  terrace info alps.tif                                what a raster holds and how deep it can be served");
  app.set_version_flag("--version", "terrace " TERRACE_VERSION);
  app.require_subcommand(1);
  app.fallthrough(false);
  int exit_code = kExitOk;
  AddServe(app, exit_code);
  AddMesh(app, exit_code);
  AddInfo(app, exit_code);
  if (argc == 1) {
    std::fputs(app.help().c_str(), stderr);
    return kExitUsage;
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);  // --help, --version
    const auto chosen = app.get_subcommands();
    std::fprintf(stderr, "terrace: %s\nRun 'terrace %s%s--help' for what is accepted.\n", error.what(),
                 chosen.empty() ? "" : chosen.front()->get_name().c_str(), chosen.empty() ? "" : " ");
    return kExitUsage;
  }
  return exit_code;
}

}  // namespace
}  // namespace terrace::cli

int main(int argc, char** argv) {
  try {
    return terrace::cli::Run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "terrace: %s\n", error.what());
    return terrace::cli::kExitFailure;
  }
}
