// terrace_tin_bench prints the engine's targets as tables, compared with the meshers that the command line names.
#include <CLI/CLI.hpp>
#include <exception>
#include <fstream>
#include <iostream>

#include "tests/bench/machine.h"
#include "tests/bench/targets.h"

namespace terrace::bench {
namespace {

int Measure(const Options& options, const std::string& json_path) {
  std::ofstream out;
  if (!json_path.empty()) {
    out.open(json_path);  // fails before the work if the file cannot be written
    if (!out) Die(json_path + ": cannot be written");
  }
  Environment environment(options);
  nlohmann::ordered_json tables = nlohmann::ordered_json::array();
  const nlohmann::ordered_json context = MachineContext();  // before the work, which would increase the load
  for (const auto& measure :
       {MeasureTiles, MeasureTilesEverywhere, MeasureVertexGoals, MeasureLargeRasters, MeasureReplay, MeasureSweep,
        MeasureDataDependent, MeasureDataDependentQuality, MeasureDropPass, MeasureMemory, MeasureVertices}) {
    const Table table = measure(environment);
    if (table.empty()) continue;
    table.Print(std::cout);
    tables.push_back(table.Json());
  }
  if (tables.empty()) Die("no case left: look at --filter and TERRACE_TEST_DATA");
  if (json_path.empty()) return 0;
  out << nlohmann::ordered_json{{"context", context},
                                {"options",
                                 {{"runs", options.runs},
                                  {"peer", options.peer},
                                  {"data_dependent_peer", options.data_dependent_peer},
                                  {"filter", options.filter}}},
                                {"tables", tables}}
             .dump(2)
      << '\n';
  out.close();
  if (!out) Die(json_path + ": cannot be written");
  return 0;
}

}  // namespace
}  // namespace terrace::bench

int main(int argc, char** argv) {
  CLI::App app(
      "Measures the mesher: CPU time of one thread, the minimum and the median of interleaved runs.\n"
      "A peer is a command that gets FILE WIDTH HEIGHT GOAL as last arguments: raw float32 heights, and error=METRES "
      "or\n"
      "points=VERTICES. For each time it meshed it prints `seconds S points M`, the CPU time of meshing alone.");
  terrace::bench::Options options;
  std::string json_path;
  app.add_option("--runs", options.runs, "turns of every race")->check(CLI::PositiveNumber)->capture_default_str();
  app.add_option("--filter", options.filter, "regular expression: cases to run, such as 'T1 .* 5 m'");
  app.add_option("--peer", options.peer, "another Delaunay mesher to run in turns with ours");
  app.add_option("--data-dependent-peer", options.data_dependent_peer, "another data-dependent mesher");
  app.add_option("--json", json_path, "file for the results, with the machine, the compiler and the commit");
  CLI11_PARSE(app, argc, argv);
  try {
    return terrace::bench::Measure(options, json_path);
  } catch (const std::exception& error) {
    std::cerr << "terrace_tin_bench: " << error.what() << std::endl;
    return 1;
  }
}
