// terrace fly: a client that flies over a served dataset, and reports how it was served.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <fstream>
#include <memory>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "fly/flight/flight.h"
#include "fly/report/html_report.h"
#include "fly/report/requirement.h"
#include "fly/report/summary.h"
#include "server/cli/common/command.h"

namespace terrace::cli {
namespace {

struct FlyArguments {
  std::string url, path, from, to, circle, format = "terrain", report, urls, require;
  double speed = 200, fps = 60, fov = 60, pitch = -20, sse = 16, duration = -1, timeout = 30, first_view_limit = 30;
  int clients = 1, loads = 20, width = 1920, height = 1080, cache_mb = 512;
  bool json = false, forbid_holes = false, insecure = false;
  std::vector<std::string> headers;
};

std::atomic<bool> stop_requested = false;

extern "C" void RequestStop(int /*signal*/) { stop_requested = true; }

// "-156.6,20.9,3000": `count` numbers separated by commas.
std::optional<std::vector<double>> ParseNumbers(const std::string& text, std::size_t count) {
  std::vector<double> numbers;
  std::istringstream parts(text);
  for (std::string part; std::getline(parts, part, ',');) {
    try {
      std::size_t used = 0;
      numbers.push_back(std::stod(part, &used));
      if (used != part.size() || !std::isfinite(numbers.back())) return std::nullopt;
    } catch (const std::exception&) {
      return std::nullopt;
    }
  }
  return numbers.size() == count ? std::optional(numbers) : std::nullopt;
}

Result<fly::GeodeticPoint> ParsePoint(const char* option, const std::string& text) {
  const std::optional<std::vector<double>> n = ParseNumbers(text, 3);
  if (!n || std::abs((*n)[0]) > 360 || std::abs((*n)[1]) > 90) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{} {}: give longitude and latitude in degrees and a height in metres, such as -156.6,20.9,3000",
                     option, text);
  }
  return fly::GeodeticPoint{(*n)[0], (*n)[1], (*n)[2]};
}

Result<fly::FlightPath> PathOf(const FlyArguments& arguments) {
  const fly::FlightSpeed speed{arguments.speed, arguments.pitch};
  const int ways = !arguments.path.empty() + !arguments.from.empty() + !arguments.circle.empty();
  if (ways != 1 || arguments.from.empty() != arguments.to.empty()) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "fly needs exactly one way: --path FILE, --from and --to, or --circle LON,LAT,H,RADIUS");
  }
  if (!arguments.path.empty()) {
    std::ifstream file(arguments.path, std::ios::binary);
    std::ostringstream text;
    if (!file || !(text << file.rdbuf())) {
      return MakeError(ErrorCode::kNotFound, "--path {}: the file cannot be read, or is empty", arguments.path);
    }
    Result<fly::FlightPath> path = fly::ParsePath(text.str(), speed);
    if (!path) return MakeError(ErrorCode::kInvalidArgument, "--path {}: {}", arguments.path, path.error().message);
    return path;
  }
  if (!arguments.circle.empty()) {
    const std::optional<std::vector<double>> n = ParseNumbers(arguments.circle, 4);
    if (!n || std::abs((*n)[0]) > 360 || std::abs((*n)[1]) > 90 || (*n)[3] <= 0 || (*n)[3] >= 5e6) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "--circle {}: give longitude, latitude, height and radius, such as -156.6,20.9,3000,20000",
                       arguments.circle);
    }
    return fly::MakeCircle({(*n)[0], (*n)[1], (*n)[2]}, (*n)[3], speed);
  }
  const Result<fly::GeodeticPoint> from = ParsePoint("--from", arguments.from), to = ParsePoint("--to", arguments.to);
  if (!from) return tl::unexpected(from.error());
  if (!to) return tl::unexpected(to.error());
  return fly::MakeStraightPath(*from, *to, speed);
}

// The document of a dataset: the URL itself if it names one, else the one of the format below it.
Result<fly::Url> DocumentOf(const FlyArguments& arguments) {
  Result<fly::Url> url = fly::ParseUrl(arguments.url);
  if (!url) return url;
  std::string& target = url->target;
  const std::size_t query = std::min(target.find('?'), target.size());
  const std::string path = target.substr(0, query);
  if (path.ends_with(".json")) return url;
  const char* name = arguments.format == "terrain" ? "layer.json" : "tileset.json";
  target = path + (path.ends_with('/') ? "" : "/") + name + target.substr(query);
  return url;
}

Result<fly::FlightOptions> OptionsOf(const FlyArguments& arguments) {
  fly::FlightOptions options;
  Result<fly::Url> document = DocumentOf(arguments);
  if (!document) return tl::unexpected(document.error());
  Result<fly::FlightPath> path = PathOf(arguments);
  if (!path) return tl::unexpected(path.error());
  for (const std::string& header : arguments.headers) {
    if (header.find(':') == std::string::npos || header.find_first_of("\r\n") != std::string::npos) {
      return MakeError(ErrorCode::kInvalidArgument, "--header: give it as \"Name: value\"");
    }
  }
  options.document = *std::move(document);
  options.format =
      options.document.target.find("tileset.json") != std::string::npos ? fly::Format::k3dTiles : fly::Format::kTerrain;
  if (options.document.target.find(".json") != std::string::npos && arguments.format == "3dtiles") {
    options.format = fly::Format::k3dTiles;
  }
  options.path = *std::move(path);
  options.duration_s = arguments.duration >= 0 ? arguments.duration : std::max(10.0, options.path.duration_s());
  options.lens = {arguments.width, arguments.height, arguments.fov};
  options.select.max_error_px = arguments.sse;
  options.select.culled_error_px = std::max(64.0, arguments.sse);
  options.select.forbid_holes = arguments.forbid_holes;
  options.frames_per_second = arguments.fps;
  options.clients = arguments.clients;
  options.max_loads = arguments.loads;
  options.max_tile_bytes = static_cast<std::uint64_t>(arguments.cache_mb) << 20;
  options.first_view_limit_s = arguments.first_view_limit;
  options.arrival_limit_s = std::min(options.arrival_limit_s, arguments.first_view_limit);
  options.http.timeout_s = arguments.timeout;
  options.http.headers = arguments.headers;
  options.http.verifies_certificates = !arguments.insecure;
  return options;
}

bool WriteFile(const std::string& path, const std::string& text) {
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  file << text;
  file.close();
  if (file) return true;
  std::fprintf(stderr, "terrace: %s cannot be written\n", path.c_str());
  return false;
}

int RunFly(const FlyArguments& arguments) {
  const Result<fly::FlightOptions> options = OptionsOf(arguments);
  if (!options) return Fail(options.error().message, kExitUsage);
  const Result<std::vector<fly::Requirement>> requirements = fly::ParseRequirements(arguments.require);
  if (!requirements) return Fail(requirements.error().message, kExitUsage);
  std::signal(SIGINT, RequestStop);
  std::signal(SIGTERM, RequestStop);
  fly::Statistics statistics(options->clients);
  std::FILE* const log = arguments.json ? stderr : stdout;
  fmt::print(log, "{}: {:.1f} km in {:.0f} s, {} client{}\n", options->document.Text(), options->path.length_m() / 1000,
             options->duration_s, options->clients, options->clients == 1 ? "" : "s");
  fly::Fly(
      *options, stop_requested,
      [&](std::size_t i) {
        fmt::print(log, "{}\n", fly::LineOf(i, statistics.second(i)));
        std::fflush(log);
      },
      statistics);

  const fly::Summary summary = fly::Summarize(*options, statistics);
  const fly::Judgements judgements = fly::Judge(*requirements, summary);
  bool written = true;
  if (!arguments.report.empty()) {
    written &= WriteFile(arguments.report, fly::HtmlOf(*options, summary, judgements, statistics));
  }
  if (!arguments.urls.empty()) {
    std::string lines;
    for (const std::string& url : statistics.urls()) lines += url + "\n";
    written &= WriteFile(arguments.urls, lines);
  }
  if (arguments.json) {
    fmt::print("{}", fly::JsonOf(*options, summary, judgements, statistics.seconds()));
  } else {
    fmt::print("\n{}", fly::TextOf(summary));
    for (const fly::Judgement& judgement : judgements.all) {
      fmt::print("{} {}: {}\n", judgement.holds ? "holds " : "FAILS ", judgement.requirement.text, judgement.shown);
    }
  }
  const bool has_flown = summary.totals.tiles > 0 && summary.never_opened == 0;
  return FinishOutput(has_flown && written && judgements.AllHold() ? kExitOk : kExitFailure);
}

}  // namespace

void AddFly(CLI::App& app, int& exit_code) {
  auto arguments = std::make_shared<FlyArguments>();
  CLI::App* fly = app.add_subcommand("fly", "Flies over a served dataset as a client, and reports how it was served.");
  fly->group(kCommands);
  fly->footer(
      "Loads the tiles that cesium-native would load on this way, in real time, and prints a line each second.\n"
      "Exit status 1: a requirement of --require failed, or nothing could be loaded. docs/flying.md explains each "
      "number.\n\n"
      "Examples:\n"
      "  terrace fly http://127.0.0.1:8080/maui --circle -156.3,20.75,4500,20000 --report maui.html\n"
      "  terrace fly http://127.0.0.1:8080/alps --from 7.6,45.9,5000 --to 8.1,46.6,5000 --format 3dtiles\n"
      "  terrace fly https://tiles.example.org/alps --path way.csv --clients 20 --require "
      "full-view=2s,p99=50ms,holes=0");
  FlyArguments& a = *arguments;
  fly->add_option("url", a.url, "URL of a dataset, or of its layer.json or tileset.json")->required()->type_name("URL");
  const char* const way = "Way";
  fly->add_option("--path", a.path,
                  "File of points: lon,lat,height[,heading,pitch] or seconds,lon,lat,height,heading,pitch a "
                  "line, or GeoJSON with a LineString")
      ->type_name("FILE")
      ->group(way);
  fly->add_option("--from", a.from, "Start, degrees and metres above the ellipsoid")
      ->type_name("LON,LAT,H")
      ->group(way);
  fly->add_option("--to", a.to, "End; the client flies back and forth")->type_name("LON,LAT,H")->group(way);
  fly->add_option("--circle", a.circle, "Circle around a place, metres")->type_name("LON,LAT,H,RADIUS")->group(way);
  fly->add_option("--speed", a.speed, "Metres per second")
      ->type_name("M/S")
      ->check(CLI::Range(0.001, 1e7))
      ->capture_default_str()
      ->group(way);
  fly->add_option("--pitch", a.pitch, "Degrees; 0 looks at the horizon, -90 down")
      ->check(CLI::Range(-90.0, 90.0))
      ->capture_default_str()
      ->group(way);
  fly->add_option("--duration", a.duration, "Seconds of the flight; default: once along the way, at least 10")
      ->type_name("S")
      ->check(CLI::Range(0.0, 7 * 86400.0))
      ->group(way);
  const char* const client = "Client";
  fly->add_option("--format", a.format, "What to load")
      ->check(CLI::IsMember({"terrain", "3dtiles"}))
      ->capture_default_str()
      ->group(client);
  fly->add_option("--clients", a.clients, "Clients that fly at a time, spread evenly over the way")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str()
      ->group(client);
  fly->add_option("--sse", a.sse, "Screen error in pixels from which a tile is refined")
      ->type_name("PX")
      ->check(CLI::Range(0.5, 1000.0))
      ->capture_default_str()
      ->group(client);
  fly->add_option("--fps", a.fps, "Frames per second")
      ->check(CLI::Range(1.0, 240.0))
      ->capture_default_str()
      ->group(client);
  fly->add_option("--fov", a.fov, "Field of view in degrees, across the screen")
      ->check(CLI::Range(1.0, 170.0))
      ->capture_default_str()
      ->group(client);
  fly->add_option("--width", a.width, "Pixels of the screen")
      ->check(CLI::Range(1, 32768))
      ->capture_default_str()
      ->group(client);
  fly->add_option("--height", a.height, "Pixels of the screen")
      ->check(CLI::Range(1, 32768))
      ->capture_default_str()
      ->group(client);
  fly->add_option("--loads", a.loads, "Requests of a client at a time")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str()
      ->group(client);
  fly->add_option("--cache", a.cache_mb, "Decoded tiles that a client keeps")
      ->type_name("MIB")
      ->check(CLI::Range(1, 65536))
      ->capture_default_str()
      ->group(client);
  fly->add_flag("--forbid-holes", a.forbid_holes, "Load all four siblings before any of them is drawn");
  fly->add_option("--header", a.headers, "\"Name: value\" for each request; may be repeated")
      ->type_name("HEADER")
      ->group(client);
  fly->add_flag("--insecure", a.insecure, "Accept any TLS certificate");
  fly->add_option("--timeout", a.timeout, "Seconds until a request without a complete reply is given up")
      ->type_name("S")
      ->check(CLI::Range(0.1, 3600.0))
      ->capture_default_str()
      ->group(client);
  fly->add_option("--first-view-limit", a.first_view_limit,
                  "Seconds that a client waits for a full view before it takes off")
      ->type_name("S")
      ->check(CLI::Range(0.1, 3600.0))
      ->capture_default_str()
      ->group(client);
  const char* const output = "Report";
  fly->add_option("--report", a.report, "Page with plots, without references to other files")
      ->type_name("FILE.html")
      ->group(output);
  fly->add_flag("--json", a.json, "Report as JSON on stdout; progress goes to stderr");
  fly->add_option("--urls", a.urls, "Paths of all requested tiles, in order, one a line")
      ->type_name("FILE")
      ->group(output);
  fly->add_option("--require", a.require,
                  "Exit status 1 unless all hold: full-view=2s, p50=10ms, p99=50ms, refined=95%, "
                  "screen-error=20px, holes=0, errors=0, refusals=0, hits=80%, tiles=30")
      ->type_name("LIST")
      ->group(output);
  fly->callback([arguments, &exit_code] { exit_code = RunFly(*arguments); });
}

}  // namespace terrace::cli
