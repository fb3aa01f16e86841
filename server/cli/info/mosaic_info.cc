#include "server/cli/info/mosaic_info.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <vector>

#include "engine/common/box_index.h"
#include "engine/core/plain_number.h"
#include "engine/geo/error_ladder.h"

namespace terrace::cli {
namespace {

double Width(const dem::GeoBounds& box) {
  return box.west > box.east ? box.east + 360 - box.west : box.east - box.west;
}

// Degrees from one west edge eastwards to another one, 0 <= offset < 360.
double Offset(const dem::GeoBounds& from, const dem::GeoBounds& to) {
  return to.west - from.west - 360 * std::floor((to.west - from.west) / 360);
}

bool Overlap(const dem::GeoBounds& a, const dem::GeoBounds& b) {
  if (a.south >= b.north || b.south >= a.north) return false;
  return Offset(a, b) < Width(a) || Offset(a, b) + Width(b) > 360;
}

bool Covers(const dem::GeoBounds& outer, const dem::GeoBounds& inner) {
  if (inner.south < outer.south || inner.north > outer.north) return false;
  return Width(outer) >= 360 || Offset(outer, inner) + Width(inner) <= Width(outer);
}

std::string Sources(std::ptrdiff_t count) { return fmt::format("{} source{}", count, count == 1 ? "" : "s"); }
std::string SourcesLie(std::ptrdiff_t count) { return Sources(count) + (count == 1 ? " lies" : " lie"); }

// Sources by their bounds.
class BoundsIndex {
 public:
  explicit BoundsIndex(const std::vector<dem::RasterInfo>& sources) : sources_(sources), index_(EntriesOf(sources)) {}

  // Counts the sources that have an earlier source for which is_so(upper, lower) holds. Precondition: it does not hold
  // for sources that do not overlap.
  template <typename IsSo>
  std::ptrdiff_t CountUnder(const IsSo& is_so) const {
    std::ptrdiff_t count = 0;
    for (std::size_t i = 0; i < sources_.size(); ++i) {
      const std::vector<std::size_t> near = index_.Find(BoxOf(sources_[i].bounds, 0));
      count += std::any_of(near.begin(), near.end(),
                           [&](std::size_t upper) { return upper < i && is_so(sources_[upper], sources_[i]); });
    }
    return count;
  }

 private:
  static dem::Box BoxOf(const dem::GeoBounds& bounds, double turn) {
    return {bounds.west + turn, bounds.south, bounds.west + turn + Width(bounds), bounds.north};
  }
  static std::vector<dem::BoxIndex::Entry> EntriesOf(const std::vector<dem::RasterInfo>& sources) {
    std::vector<dem::BoxIndex::Entry> entries;
    for (std::size_t i = 0; i < sources.size(); ++i) {
      for (const double turn : {-360, 0, 360}) entries.push_back({BoxOf(sources[i].bounds, turn), i});
    }
    return entries;
  }

  const std::vector<dem::RasterInfo>& sources_;
  const dem::BoxIndex index_;
};

// Counts sources that are at least partly hidden by an earlier one.
std::ptrdiff_t CountOverlapped(const std::vector<dem::RasterInfo>& sources) {
  return BoundsIndex(sources).CountUnder(
      [](const dem::RasterInfo& upper, const dem::RasterInfo& lower) { return Overlap(upper.bounds, lower.bounds); });
}

// Counts sources that are completely hidden by a coarser one.
std::ptrdiff_t CountHidden(const std::vector<dem::RasterInfo>& sources) {
  return BoundsIndex(sources).CountUnder([](const dem::RasterInfo& upper, const dem::RasterInfo& lower) {
    return upper.spacing_m > lower.spacing_m && Covers(upper.bounds, lower.bounds);
  });
}

std::vector<std::string> AdviceFor(const dem::DemInfo& info) {
  const auto count = [&](auto is_so) { return std::ranges::count_if(info.sources, is_so); };
  const auto large = count([](const dem::RasterInfo& s) {
    const bool has_averages = s.min_kept_factor > 0 && s.min_kept_factor <= 4;
    return IsLargeWithoutOverviews(s) && !has_averages;
  });
  const auto no_datum = count([](const dem::RasterInfo& s) { return s.datum_in_use.empty(); });
  const auto voids = count([](const dem::RasterInfo& s) { return s.void_samples > 0; });
  std::vector<std::string> advice;
  if (const std::ptrdiff_t hidden = CountHidden(info.sources); hidden > 0) {
    advice.push_back(fmt::format(
        "{} within the bounds of a coarser one that comes before, and finer heights show only in its voids: name finer "
        "sources first",
        SourcesLie(hidden)));
  }
  const auto add_each = [&](auto text_of) {
    for (const dem::RasterInfo& source : info.sources) {
      if (const std::string text = text_of(source); !text.empty()) {
        advice.push_back(fmt::format("{}: {}; `terrace info` of this file says more", source.path, text));
      }
    }
  };
  add_each([](const dem::RasterInfo& s) {
    return s.picture_color.empty() ? ""
                                   : fmt::format("band 1 is the \"{}\" of a picture, hardly heights", s.picture_color);
  });
  add_each([](const dem::RasterInfo& s) { return s.heights_doubted; });
  if (large > 0) {
    advice.push_back(fmt::format(
        "large, without overviews, and their averages are not kept: {}; shallow tiles read many of their samples: give "
        "terrace a cache_dir with room, or run 'gdaladdo -r average' on each",
        Sources(large)));
  }
  if (no_datum > 0) {
    advice.push_back(
        fmt::format("{} of {} sources state no vertical datum: heights are taken as metres above the WGS 84 ellipsoid "
                    "as they are; where datums differ there are steps between sources; state what they count from with "
                    "--vertical egm96, or \"vertical\" of each source in the configuration",
                    no_datum, info.sources.size()));
  }
  if (voids > 0) {
    advice.push_back(fmt::format(
        "with voids: {}; small ones are filled from their edges, larger ones show the next source; then those with "
        "data all around them are filled with a smooth surface, and those that touch the rim show the floor of {} m",
        Sources(voids), PlainNumber(info.floor)));
  }
  return advice;
}

}  // namespace

bool IsLargeWithoutOverviews(const dem::RasterInfo& info) {
  constexpr std::int64_t kLarge = std::int64_t{4096} * 4096;
  return info.overview_factors.empty() && std::int64_t{info.width} * info.height > kLarge;
}

std::string TextOfBounds(const dem::GeoBounds& bounds) {
  return fmt::format("west {}, south {}, east {}, north {}", PlainNumber(bounds.west, 9), PlainNumber(bounds.south, 9),
                     PlainNumber(bounds.east, 9), PlainNumber(bounds.north, 9));
}

void PrintMosaic(const std::string& name, const dem::DemInfo& info) {
  const auto line = [](const char* what, const std::string& value) { fmt::print("  {:<14}{}\n", what, value); };
  fmt::print("{}\n", name);
  line("sources", fmt::format("{}, in the order in which they count", info.sources.size()));
  constexpr std::size_t kMaxListed = 40;
  for (std::size_t i = 0; i < std::min(info.sources.size(), kMaxListed); ++i) {
    const dem::RasterInfo& source = info.sources[i];
    line("", fmt::format("{}: {} x {}, {} m, {}", source.path, source.width, source.height,
                         PlainNumber(source.spacing_m, 3), source.crs));
  }
  if (info.sources.size() > kMaxListed) line("", fmt::format("and {} more", info.sources.size() - kMaxListed));
  line("overlaps",
       fmt::format("{} at least partly under one that comes before", SourcesLie(CountOverlapped(info.sources))));
  line("bounds", TextOfBounds(info.bounds));
  line("heights", fmt::format("{} to {} m", PlainNumber(info.heights.min), PlainNumber(info.heights.max)));
  line("floor", fmt::format("{} m where no source has a height", PlainNumber(info.floor)));
  line("levels", fmt::format("0 to {}, default error {} m at the deepest, which lies where the finest source does",
                             info.max_level, PlainNumber(geo::DefaultError(info.max_level), 3)));
  for (const std::string& advice : AdviceFor(info)) line("note", advice);
}

std::string MosaicJson(const std::string& name, const dem::DemInfo& info) {
  nlohmann::json sources = nlohmann::json::array();
  for (const dem::RasterInfo& source : info.sources) {
    sources.push_back({{"path", source.path},
                       {"width", source.width},
                       {"height", source.height},
                       {"crs", source.crs},
                       {"vertical_datum", source.vertical_datum},
                       {"counts_from", source.datum_in_use},
                       {"vertical_operation", source.vertical_operation},
                       {"spacing_m", source.spacing_m},
                       {"bounds", {source.bounds.west, source.bounds.south, source.bounds.east, source.bounds.north}},
                       {"void_samples", source.void_samples},
                       {"hole_samples", source.enclosed_samples},
                       {"overviews", source.overview_factors}});
  }
  const nlohmann::json mosaic = {{"path", name},
                                 {"sources", std::move(sources)},
                                 {"overlapped", CountOverlapped(info.sources)},
                                 {"bounds", {info.bounds.west, info.bounds.south, info.bounds.east, info.bounds.north}},
                                 {"heights", {{"min", info.heights.min}, {"max", info.heights.max}}},
                                 {"floor", info.floor},
                                 {"levels", {0, info.max_level}},
                                 {"advice", AdviceFor(info)}};
  return mosaic.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace terrace::cli
