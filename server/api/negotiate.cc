#include "server/api/negotiate.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <limits>
#include <optional>
#include <utility>

#include "engine/geo/error_ladder.h"
#include "server/http/text.h"

namespace terrace::server {
namespace {

constexpr std::string_view kBlanksAndQuotes = " \t\"";

// The coding of a name; nothing if it is not supported.
std::optional<tiler::Coding> CodingOf(std::string_view name) {
  if (EqualsIgnoringCase(name, "identity")) return tiler::Coding::kIdentity;
  if (EqualsIgnoringCase(name, "x-gzip")) return tiler::Coding::kGzip;
  for (const tiler::Coding coding : tiler::kCodings) {
    if (EqualsIgnoringCase(name, tiler::NameOf(coding))) return coding;
  }
  return std::nullopt;
}

// A malformed quality, or one outside 0 .. 1, counts as 0.
double Quality(std::string_view parameters) {
  while (!parameters.empty()) {
    const std::string_view parameter = NextPiece(parameters, ';', kBlanksAndQuotes);
    if (!parameter.starts_with("q=") && !parameter.starts_with("Q=")) continue;
    double quality = 0;
    const char* const last = parameter.data() + parameter.size();
    const auto [end, error] = std::from_chars(parameter.data() + 2, last, quality, std::chars_format::fixed);
    return error == std::errc() && end == last && quality >= 0 && quality <= 1 ? quality : 0;
  }
  return 1;
}

}  // namespace

tiler::Coding NegotiateCoding(std::string_view accept_encoding, std::span<const tiler::Coding> offered) {
  constexpr std::size_t kKnown = 1 + tiler::kCodings.size();
  std::array<std::optional<double>, kKnown> named;  // qualities, by coding
  std::optional<double> any;
  while (!accept_encoding.empty()) {
    std::string_view item = NextPiece(accept_encoding, ',', kBlanksAndQuotes);
    const std::string_view name = NextPiece(item, ';', kBlanksAndQuotes);
    const double quality = Quality(item);
    if (name == "*") {
      any = quality;
    } else if (const std::optional<tiler::Coding> coding = CodingOf(name)) {
      std::optional<double>& known = named[static_cast<std::size_t>(*coding)];
      known = std::max(known.value_or(0), quality);
    }
  }
  // Identity is acceptable if it is not mentioned, but only if no other coding is.
  tiler::Coding best = tiler::Coding::kIdentity;
  double most = named[static_cast<std::size_t>(tiler::Coding::kIdentity)].value_or(0);
  for (const tiler::Coding coding : offered) {
    const double quality = named[static_cast<std::size_t>(coding)].value_or(any.value_or(0));
    if (quality <= 0 || quality < most || (quality == most && best != tiler::Coding::kIdentity)) continue;
    best = coding;
    most = quality;
  }
  return best;
}

proto::TileExtensions WantedExtensions(std::string_view accept, const std::vector<std::string>& query_extensions) {
  proto::TileExtensions wanted = proto::ExtensionsInAccept(accept);
  for (const std::string& names : query_extensions) wanted = wanted | proto::ParseExtensions(names);
  return wanted;
}

int ErrorStep(const RequestedError& requested, int level, bool is_deepest, double error_fraction) {
  if (requested.fraction) {
    // The product may overflow or underflow; the ladder's ends lie far inside the range of doubles.
    const double error_m = std::clamp(*requested.fraction * geo::LevelError(level), std::numeric_limits<double>::min(),
                                      std::numeric_limits<double>::max());
    return geo::SnapToLadder(level, error_m, error_fraction);
  }
  if (!requested.error_m) return 0;
  const int step = geo::SnapToLadder(level, *requested.error_m, error_fraction);
  // max(error, default): steps above 0 are finer than the default.
  return requested.at_least && !is_deepest ? std::min(step, 0) : step;
}

Result<std::uint32_t> FindDataset(std::string_view name, std::span<const DatasetView> datasets) {
  for (std::size_t i = 0; i < datasets.size(); ++i) {
    if (datasets[i].name == name) return static_cast<std::uint32_t>(i);
  }
  return MakeError(ErrorCode::kNotFound, "no such dataset; /datasets lists them");
}

Result<tiler::TileRequest> Negotiate(const Call& call, std::span<const DatasetView> datasets) {
  const Route& route = call.route;
  const Result<std::uint32_t> dataset = FindDataset(route.dataset, datasets);
  if (!dataset) return tl::unexpected(dataset.error());
  tiler::TileRequest tile;
  tile.dataset = *dataset;
  tile.key = route.key;
  tile.format = route.format->format;
  if (Result<void> read = route.format->read(route.query, *call.request->fields, datasets[*dataset], tile); !read) {
    return tl::unexpected(std::move(read.error()));
  }
  return tile;
}

}  // namespace terrace::server
