#include "server/cli/fly/fly_arguments.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <exception>
#include <fstream>
#include <optional>
#include <sstream>
#include <string_view>
#include <type_traits>
#include <utility>

#include "server/cli/common/option_checks.h"

namespace terrace::cli {
namespace {

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

// Longitude, latitude, height and further numbers, `count` in all. `what`: names them in the message.
Result<std::vector<double>> ParsePlace(const char* option, const std::string& text, std::size_t count,
                                       const char* what) {
  const auto wrong = [&](const std::string& why) {
    return MakeError(ErrorCode::kInvalidArgument, "{} {}: {}", option, text, why);
  };
  const std::optional<std::vector<double>> n = ParseNumbers(text, count);
  if (!n) return wrong(std::string("give ") + what);
  if (const Result<void> checked = fly::CheckPosition({(*n)[0], (*n)[1], (*n)[2]}); !checked) {
    return wrong(checked.error().message + "; give " + what);
  }
  return *n;
}

Result<fly::GeodeticPoint> ParsePoint(const char* option, const std::string& text) {
  const Result<std::vector<double>> n =
      ParsePlace(option, text, 3, "longitude and latitude in degrees and a height in metres, such as -156.6,20.9,3000");
  if (!n) return tl::unexpected(n.error());
  return fly::GeodeticPoint{(*n)[0], (*n)[1], (*n)[2]};
}

Result<fly::FlightPath> PathOf(const FlyArguments& arguments) {
  const fly::FlightSpeed speed{arguments.speed, arguments.pitch};
  const int ways = !arguments.path.empty() + !arguments.from.empty() + !arguments.circle.empty();
  if (ways != 1 || arguments.from.empty() != arguments.to.empty()) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "fly needs exactly one path: --path FILE, --from and --to, or --circle LON,LAT,H,RADIUS");
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
    const Result<std::vector<double>> n = ParsePlace(
        "--circle", arguments.circle, 4, "longitude, latitude, height and radius, such as -156.6,20.9,3000,20000");
    if (!n) return tl::unexpected(n.error());
    const double radius_m = (*n)[3];
    if (radius_m <= 0 || radius_m >= fly::kMaxCircleRadius) {
      return MakeError(ErrorCode::kInvalidArgument, "--circle {}: the radius must be above 0 and below {:.0f} m",
                       arguments.circle, fly::kMaxCircleRadius);
    }
    return fly::MakeCircle({(*n)[0], (*n)[1], (*n)[2]}, radius_m, speed);
  }
  const Result<fly::GeodeticPoint> from = ParsePoint("--from", arguments.from), to = ParsePoint("--to", arguments.to);
  if (!from) return tl::unexpected(from.error());
  if (!to) return tl::unexpected(to.error());
  if (fly::AreOpposite(*from, *to)) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "--from {} --to {}: are on opposite sides of the Earth, so that no way between them is the "
                     "shortest; give the way with --path",
                     arguments.from, arguments.to);
  }
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

// "Name: value". Messages do not repeat the text, which may be a password.
Result<std::pair<std::string, std::string>> ParseHeader(const std::string& text) {
  constexpr std::string_view kNameCharacters =  // RFC 9110, 5.6.2
      "!#$%&'*+-.^_`|~0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz";
  constexpr std::string_view kBlanks = " \t";
  const std::size_t colon = text.find_first_not_of(kNameCharacters);
  if (colon == 0 || colon == std::string::npos || text[colon] != ':') {
    return MakeError(ErrorCode::kInvalidArgument,
                     "--header: no name of letters, digits and hyphens before a colon; give it as \"Name: value\"");
  }
  const std::size_t begin = std::min(text.find_first_not_of(kBlanks, colon + 1), text.size());
  std::string value = text.substr(begin, text.find_last_not_of(kBlanks) + 1 - begin);
  if (std::any_of(value.begin(), value.end(), [](unsigned char c) { return (c < ' ' && c != '\t') || c == 0x7F; })) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "--header: the value has a line break or another control character; give it as \"Name: value\"");
  }
  return std::pair(text.substr(0, colon), std::move(value));
}

}  // namespace

Result<fly::FlightOptions> OptionsOf(const FlyArguments& arguments) {
  fly::FlightOptions options;
  Result<fly::Url> document = DocumentOf(arguments);
  if (!document) return tl::unexpected(document.error());
  Result<fly::FlightPath> path = PathOf(arguments);
  if (!path) return tl::unexpected(path.error());
  for (const std::string& text : arguments.headers) {
    auto header = ParseHeader(text);
    if (!header) return tl::unexpected(header.error());
    options.http.headers.push_back(*std::move(header));
  }
  options.document = *std::move(document);
  const std::string& target = options.document.target;
  const bool is_3d = arguments.format == "3dtiles" || target.substr(0, target.find('?')).ends_with("tileset.json");
  options.format = is_3d ? fly::Format::k3dTiles : fly::Format::kTerrain;
  options.path = *std::move(path);
  options.duration_s = arguments.duration >= 0 ? arguments.duration : std::max(10.0, options.path.duration_s());
  options.lens = {arguments.width, arguments.height, arguments.fov};
  options.select.max_error_px = arguments.sse;
  options.select.culled_error_px = std::max(64.0, arguments.sse);
  options.select.forbid_holes = arguments.forbid_holes;
  options.frames_per_second = arguments.fps;
  options.clients = arguments.clients;
  options.max_loads = arguments.loads;
  options.max_tile_bytes = static_cast<std::uint64_t>(arguments.cache_mib) << 20;
  options.first_view_limit_s = arguments.first_view_limit;
  options.arrival_limit_s = std::min(options.arrival_limit_s, arguments.first_view_limit);
  options.keeps_urls = !arguments.urls.empty();
  options.http.timeout_s = arguments.timeout;
  options.http.verifies_certificates = !arguments.insecure;
  return options;
}

namespace {

// A number whose default the help shows, but not its range; an error does.
template <typename T>
void AddNumber(CLI::App& command, const char* name, T& value, const char* type, T low, T high, const char* text) {
  command.add_option(name, value, text)
      ->type_name(type)
      ->check(NumberFrom(low, high,
                         fmt::format("a {}number from {} to {}", std::is_integral_v<T> ? "whole " : "", low, high)))
      ->capture_default_str();
}

void AddPathFlags(CLI::App& command, FlyArguments& a) {
  command.option_defaults()->group("Flight path");
  command
      .add_option(
          "--path", a.path,
          "File of points, one on each line: lon,lat,height[,heading,pitch] or seconds,lon,lat,height,heading,pitch; "
          "or GeoJSON with a LineString")
      ->type_name("FILE");
  command.add_option("--from", a.from, "Start, degrees and metres above the ellipsoid")->type_name("LON,LAT,H");
  command.add_option("--to", a.to, "End; the client flies back and forth")->type_name("LON,LAT,H");
  command.add_option("--circle", a.circle, "Circle around a place: degrees; height and radius in metres")
      ->type_name("LON,LAT,H,RADIUS");
  AddNumber(command, "--speed", a.speed, "M/S", 0.001, 1e7, "Metres per second");
  AddNumber(command, "--pitch", a.pitch, "DEGREES", -90.0, 90.0,
            "Pitch of the camera if the path has none: 0 is the horizon, -90 straight down");
  command.add_option("--duration", a.duration, "Seconds of the flight; default: once along the path, at least 10")
      ->type_name("S")
      ->check(NumberFrom<double>(0, 7 * 86400, "a number of seconds from 0 to 604800"));
}

void AddClientFlags(CLI::App& command, FlyArguments& a) {
  command.option_defaults()->group("Client");
  command.add_option("--format", a.format, "What to load")
      ->type_name("terrain|3dtiles")
      ->check(CLI::IsMember({"terrain", "3dtiles"}).description(""))
      ->capture_default_str();
  AddNumber(command, "--clients", a.clients, "N", 1, 1000, "Clients that fly at a time, spread evenly over the path");
  AddNumber(command, "--sse", a.sse, "PX", 0.5, 1000.0, "Screen error from which a tile is refined");
  AddNumber(command, "--fps", a.fps, "N", 1.0, 240.0, "Frames per second");
  AddNumber(command, "--fov", a.fov, "DEGREES", 1.0, 170.0, "Field of view, across the screen");
  AddNumber(command, "--width", a.width, "PX", 1, 32768, "Width of the screen");
  AddNumber(command, "--height", a.height, "PX", 1, 32768, "Height of the screen");
  AddNumber(command, "--loads", a.loads, "N", 1, 1000, "Requests of a client at a time");
  AddNumber(command, "--cache", a.cache_mib, "MIB", 1, 65536, "Memory for the decoded tiles of one client");
  command.add_flag("--forbid-holes", a.forbid_holes, "Load all four siblings before any of them is drawn");
  command.add_option("--header", a.headers, "\"Name: value\" for each request to the server of URL; may be repeated")
      ->type_name("HEADER");
  command.add_flag("--insecure", a.insecure, "Accept any TLS certificate");
  AddNumber(command, "--timeout", a.timeout, "S", 0.1, 3600.0,
            "Longest time of connecting to a resolved host, and from a request to its complete reply");
  AddNumber(command, "--first-view-limit", a.first_view_limit, "S", 0.1, 3600.0,
            "A client takes off after this time without a full view");
}

void AddReportFlags(CLI::App& command, FlyArguments& a) {
  command.option_defaults()->group("Report");
  command.add_option("--report", a.report, "Page with plots, without references to other files")
      ->type_name("FILE.html");
  command.add_flag("--json", a.json, "Report as JSON on stdout; progress goes to stderr");
  command.add_option("--urls", a.urls, "Paths of all requested tiles, in order, one on each line")->type_name("FILE");
  command
      .add_option("--require", a.require,
                  "Exit status 1 unless all hold: full-view=2s, p50=10ms, p99=50ms, refined=95%, screen-error=20px, "
                  "holes=0, errors=0, refusals=0, hits=80%, tiles=30; joined by commas")
      ->type_name("LIST");
}

}  // namespace

void AddFlags(CLI::App& command, FlyArguments& arguments) {
  command.add_option("url", arguments.url, "URL of a dataset, or of its layer.json or tileset.json")
      ->required()
      ->type_name("URL");
  AddPathFlags(command, arguments);
  AddClientFlags(command, arguments);
  AddReportFlags(command, arguments);
}

}  // namespace terrace::cli
