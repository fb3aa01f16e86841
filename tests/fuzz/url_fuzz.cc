// All code that parses a request's target and the headers that select a reply, on arbitrary text.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "engine/core/check.h"
#include "engine/geo/error_ladder.h"
#include "server/access/admission_control.h"
#include "server/access/client_address.h"
#include "server/api/tile_formats.h"
#include "server/http/response.h"
#include "server/http/text.h"
#include "server/query/heights_query.h"
#include "server/query/map_query.h"
#include "server/query/tile_query.h"
#include "server/routes.h"
#include "server/telemetry/redact.h"
#include "tests/fuzz/fuzz_input.h"
#include "tiler/map/contour_tile.h"

namespace terrace::fuzz {
namespace {

using namespace server;

constexpr int kDeepest = 12;

// A dataset of the whole Earth with everything that a request may name.
const std::vector<DatasetView>& Datasets() {
  static const auto* const datasets = [] {
    DatasetView view;
    view.name = "earth";
    view.has_water = true;
    view.texture = proto::TextureFormat::kJpeg;
    view.error_scale.max_source_level = kDeepest;
    view.max_mercator_depth = kDeepest;
    view.imagery = dem::ImageExtent{{-180, -90, 180, 90}, kDeepest, kDeepest};
    for (int level = 0; level <= kDeepest; ++level) {
      view.available.push_back({{0, 0, geo::TileColumns(level) - 1, geo::TileRows(level) - 1}});
    }
    return new std::vector<DatasetView>{view};
  }();
  return *datasets;
}

void ExpectClientError(const Error& error) {
  TERRACE_CHECK(error.code == ErrorCode::kInvalidArgument || error.code == ErrorCode::kNotFound);
}

void ExpectInLadder(const geo::RequestedError& requested) {
  TERRACE_CHECK(!requested.error_m || (std::isfinite(*requested.error_m) && *requested.error_m > 0));
  TERRACE_CHECK(!requested.fraction || (std::isfinite(*requested.fraction) && *requested.fraction > 0));
  for (const int level : {0, 7, geo::kMaxLevel}) {
    for (const int max_source_level : {0, geo::kMaxLevel}) {
      const int step = geo::ErrorStep(requested, level, {.max_source_level = max_source_level});
      TERRACE_CHECK(step >= geo::kCoarsestStep && step <= geo::kFinestStep);
    }
  }
}

void TryQuery(std::string_view query) {
  for (const bool at_least : {false, true}) {
    for (const bool compression : {false, true}) {
      const auto tile = ParseTileParameters(query, at_least, compression);
      if (tile) ExpectInLadder(tile->requested);
      if (!tile) ExpectClientError(tile.error());
    }
  }
  const auto height = ParseHeightTileParameters(query);
  TERRACE_CHECK(!height || height->size == 256 || height->size == 512);
  for (const auto format : {tiler::TileFormat::kHillshade, tiler::TileFormat::kSlope, tiler::TileFormat::kContours,
                            tiler::TileFormat::kImagery}) {
    const auto of_map = ParseMapParameters(query, format, /*in_tile_json=*/true);
    if (!of_map) {
      ExpectClientError(of_map.error());
      continue;
    }
    TERRACE_CHECK(of_map->size == 256 || of_map->size == 512);
    TERRACE_CHECK(of_map->map.azimuth_deg < 360 && of_map->map.altitude_deg <= 90);
    TERRACE_CHECK(of_map->map.z_factor_hundredths >= 1 && of_map->map.z_factor_hundredths <= 10'000);
    TERRACE_CHECK(of_map->map.interval_cm <= tiler::kMaxIntervalCm);
    // Written into a template, the parameters mean the same.
    const auto again = ParseMapParameters(MapTileQuery(*of_map), format);
    TERRACE_CHECK(again && again->map == of_map->map && again->size == of_map->size);
  }
  if (const auto none = RefuseParameters(query); !none) ExpectClientError(none.error());
  const auto parameters = ParseQuery(query);
  if (!parameters) return ExpectClientError(parameters.error());
  for (const auto& [name, value] : *parameters) {
    for (const unsigned char c : name + value) TERRACE_CHECK(c != 0 || query.find('\0') != std::string_view::npos);
  }
  constexpr std::size_t kMaxPoints = 50;
  const auto heights = ParseHeights({query, {}, {}}, kMaxPoints);
  if (!heights) return ExpectClientError(heights.error());
  TERRACE_CHECK(!heights->points.empty() && heights->points.size() <= kMaxPoints);
  for (const dem::GeoPosition& point : heights->points) {
    TERRACE_CHECK(std::abs(point.longitude) <= 180 && std::abs(point.latitude) <= 90);
  }
}

// One tile has one URL: writing the parsed target again gives the requested one.
void ExpectOneUrl(const Route& route) {
  std::string folder(route.format->folder);
  if (!folder.empty()) folder += '/';
  const std::string written = "/earth/" + folder + geo::ToString(route.key) + std::string(route.format->suffix);
  const auto again = Routes().Match(written);
  TERRACE_CHECK(again && again->key == route.key && again->format == route.format);
}

void TryTarget(std::string target) {
  (void)TakeToken(target);
  TERRACE_CHECK(!TakeToken(target));  // the log must not contain one
  for (const bool is_known : {false, true}) {
    const std::string shown = RedactTarget(target, is_known);
    TERRACE_CHECK(std::all_of(shown.begin(), shown.end(), [](char c) { return c > 0x20 && c < 0x7f && c != ';'; }));
  }
  const auto route = Routes().Match(target);
  if (!route) return ExpectClientError(route.error());
  TryQuery(route->query);
  TERRACE_CHECK(route->row != nullptr);
  TERRACE_CHECK(geo::IsValid(route->key) && geo::IsValid(route->root));
  if (route->format == nullptr || route->row->has_templates) return;
  ExpectOneUrl(*route);
  const Request request;
  RequestContext call;
  call.request = &request;
  call.route = *route;
  const auto wanted = NegotiateTile(call, Datasets());
  if (!wanted) return ExpectClientError(wanted.error());
  TERRACE_CHECK(wanted->dataset == 0 && wanted->key == route->key && wanted->format == route->format->format);
  TERRACE_CHECK(wanted->error_step >= geo::kCoarsestStep && wanted->error_step <= geo::kFinestStep);
  TERRACE_CHECK(wanted->key.level <= kDeepest + 1);
}

void TryHeaders(const std::string& text) {
  const tiler::Coding coding = NegotiateCoding(text);
  TERRACE_CHECK(coding == tiler::Coding::kIdentity ||
                text.find_first_of("zZbB*") != std::string::npos);  // gzip, zstd, br
  (void)WantedExtensions(text, {text});
  (void)MatchesEtag(text, "\"0123456789abcdef\"");
  static const Proxies kProxies[] = {
      {AddressRanges::Parse({"10.0.0.0/8", "::1", "fd00::/8"}).value(), config::ForwardedHeader::kXForwarded},
      {AddressRanges::Parse({"0.0.0.0/0", "::/0"}).value(), config::ForwardedHeader::kForwarded}};
  for (const Proxies& proxies : kProxies) {
    Request request;
    RequestFields fields;
    fields.forwarded = fields.forwarded_for = fields.forwarded_host = fields.forwarded_proto = text;
    request.fields = SharedFields(fields);
    const auto client = ResolveClient(request, asio::ip::make_address("10.1.2.3"), proxies);
    TERRACE_CHECK(!ClientBlock(client).empty());
    TERRACE_CHECK(IsHostValue(request.fields->host));
    Request stranger = request;
    stranger.fields.Set(&RequestFields::host, "a");
    const auto peer = asio::ip::make_address("2001:db8::1");
    if (proxies.header == config::ForwardedHeader::kXForwarded) {
      TERRACE_CHECK(ResolveClient(stranger, peer, proxies) == peer && stranger.fields->host == "a");
    }
  }
  (void)AddressRanges::Parse({text});
}

}  // namespace
}  // namespace terrace::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace terrace::fuzz;
  FuzzInput input(data, size);
  const char sort = input.Take<char>();
  const std::string text(input.rest());
  if (sort == '?') {
    TryQuery(text);
  } else if (sort == ':') {
    TryHeaders(text);
  } else {
    TryTarget(sort + text);
  }
  return 0;
}
