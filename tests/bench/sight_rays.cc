// terrace_sight_rays measures ElevationModel::LookAlong over rays of one length in all directions: CPU time of one
// thread, rays a second a core. "hash" is one of all answers, bit for bit: programs with the same answers print the
// same.
#include <fmt/format.h>
#include <xxhash.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "engine/dem/elevation_model.h"
#include "engine/geo/ellipsoid.h"
#include "tests/bench/cpu_clock.h"

namespace terrace::bench {
namespace {

struct Arguments {
  std::vector<std::string> dems;
  std::string vertical;
  std::vector<double> box = {-156.42, 20.68, -156.12, 20.82};
  std::size_t rays = 10'000;
  double length_m = 10'000, eye_m = 2, refraction = 0;
  unsigned rounds = 3;
};

// From places in the box, both ends at the same height above ground.
Result<std::vector<dem::SightRay>> RaysOver(const dem::ElevationModel& model, const Arguments& arguments) {
  std::mt19937_64 random(11);
  const auto share = [&] { return static_cast<double>(random() >> 11) * 0x1p-53; };
  std::vector<dem::GeoPosition> ends;
  for (std::size_t i = 0; i < arguments.rays; ++i) {
    const double longitude = arguments.box[0] + share() * (arguments.box[2] - arguments.box[0]);
    const double latitude = arguments.box[1] + share() * (arguments.box[3] - arguments.box[1]);
    const double turn = geo::ToRadians(360 * share());
    ends.push_back({longitude, latitude});
    ends.push_back({longitude + arguments.length_m * std::sin(turn) / geo::MetresPerDegreeEast(latitude),
                    latitude + arguments.length_m * std::cos(turn) / geo::MetresPerDegreeNorth(latitude)});
  }
  const Result<std::vector<float>> ground = model.ReadPoints(ends);
  if (!ground) return tl::unexpected(ground.error());
  std::vector<dem::SightRay> rays;
  const auto end = [&](std::size_t k) {
    const double ground_m = std::isnan((*ground)[k]) ? 0 : static_cast<double>((*ground)[k]);
    return dem::SightPoint{ends[k].longitude, ends[k].latitude, ground_m + arguments.eye_m};
  };
  for (std::size_t i = 0; i < arguments.rays; ++i) rays.push_back({end(2 * i), end(2 * i + 1)});
  return rays;
}

int Run(const Arguments& arguments) {
  std::vector<dem::DemFile> files;
  dem::DemOptions options;
  if (!arguments.vertical.empty()) options.source.vertical = arguments.vertical;
  for (const std::string& dem : arguments.dems) files.push_back({dem, static_cast<int>(files.size())});
  const auto source = dem::ElevationModel::Open(std::move(files), options);
  const auto fail = [](const Error& error) {
    std::fprintf(stderr, "terrace_sight_rays: %s\n", error.message.c_str());
    return 1;
  };
  if (!source) return fail(source.error());
  const auto rays = RaysOver(**source, arguments);
  if (!rays) return fail(rays.error());
  std::vector<double> seconds;
  std::size_t visible = 0;
  std::uint64_t hash = 0;
  for (unsigned round = 0; round < arguments.rounds; ++round) {
    Result<std::vector<dem::SightAnswer>> answers;
    seconds.push_back(SecondsOf([&] { answers = (*source)->LookAlong(*rays, {arguments.refraction}); }));
    if (!answers) return fail(answers.error());
    visible = hash = 0;
    for (const dem::SightAnswer& answer : *answers) {
      visible += answer.is_visible ? 1 : 0;
      const std::array<double, 5> values = {answer.is_visible ? 1.0 : 0.0, answer.clearance_m, answer.clearance_at,
                                            answer.blocked_at.value_or(-1), answer.has_gaps ? 1.0 : 0.0};
      hash = XXH3_64bits_withSeed(values.data(), sizeof(values), hash);
    }
  }
  std::sort(seconds.begin(), seconds.end());
  const auto count = static_cast<double>(rays->size());
  fmt::print(
      "{} rays of {} m, eye {} m: least {:.2f}, median {:.2f} microseconds a ray, {:.0f} rays/s a core; {} visible; "
      "hash {:016x}\n",
      rays->size(), arguments.length_m, arguments.eye_m, 1e6 * seconds.front() / count,
      1e6 * seconds[seconds.size() / 2] / count, count / seconds.front(), visible, hash);
  return 0;
}

}  // namespace
}  // namespace terrace::bench

int main(int argc, char** argv) {
  terrace::bench::Arguments arguments;
  CLI::App app("Times lines of sight over the sources");
  app.add_option("DEM", arguments.dems, "Rasters, in order of precedence")->required();
  app.add_option("--vertical", arguments.vertical, "The datum of their heights");
  app.add_option("--box", arguments.box, "west,south,east,north of the first ends")->delimiter(',')->expected(4);
  app.add_option("--rays", arguments.rays, "Number");
  app.add_option("--length", arguments.length_m, "Metres");
  app.add_option("--eye", arguments.eye_m, "Metres above ground, of both ends");
  app.add_option("--refraction", arguments.refraction, "Share of the Earth's curvature");
  app.add_option("--rounds", arguments.rounds, "Runs over all rays");
  CLI11_PARSE(app, argc, argv);
  return terrace::bench::Run(arguments);
}
