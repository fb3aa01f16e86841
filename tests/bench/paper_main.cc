// terrace_paper: repeats the paper's experiments. Writes paper.json and pictures into a folder.
#include <CLI/CLI.hpp>
#include <exception>
#include <filesystem>
#include <fstream>
#include <iostream>

#include "tests/bench/environment.h"
#include "tests/bench/machine.h"
#include "tests/bench/paper.h"

namespace terrace::bench {
namespace {

void Repeat(const std::string& folder) {
  std::filesystem::create_directories(folder);
  const nlohmann::ordered_json context = MachineContext();  // before the work, which would increase the load
  Results results;
  for (const auto& experiment :
       {CraterQuality, DataDependentQuality, ParallelInsertions, QualityOverVertices, TimeOverVertices}) {
    experiment(results);
  }
  nlohmann::ordered_json json{{"context", context}};
  for (const Table& table : results.tables) {
    table.Print(std::cout);
    json["tables"].push_back(table.Json());
  }
  for (const Figure& figure : results.figures) json["figures"].push_back(figure.Json());
  std::ofstream out(folder + "/paper.json");
  out << json.dump(2) << '\n';
  out.close();
  if (!out) Die(folder + "/paper.json: cannot be written");
  DrawPictures(folder);
}

}  // namespace
}  // namespace terrace::bench

int main(int argc, char** argv) {
  CLI::App app(
      "Repeats the experiments of Garland and Heckbert's paper on its five elevation models (TERRACE_TEST_DATA).");
  std::string folder = "build/paper";
  app.add_option("--out", folder, "folder for paper.json and the pictures")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  try {
    terrace::bench::Repeat(folder);
  } catch (const std::exception& error) {
    std::cerr << "terrace_paper: " << error.what() << std::endl;
    return 1;
  }
}
