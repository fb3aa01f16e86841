// A pipeline whose functions tests replace.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <stop_token>
#include <utility>
#include <vector>

#include "tiler/tile_pipeline.h"

namespace terrace::server {

using TileBuilder = std::function<Result<tiler::EncodedTile>(const tiler::TileRequest&, std::stop_token)>;
using PointReader = std::function<Result<std::vector<float>>(std::uint32_t dataset, std::span<const dem::GeoPosition>,
                                                             dem::HeightDatum, std::stop_token)>;
struct AreaMesher {
  std::function<Result<tiler::AreaPlan>(std::uint32_t dataset, const tiler::AreaRequest&)> plan;
  std::function<Result<tiler::EncodedTile>(std::uint32_t dataset, const tiler::AreaPlan&, const tiler::AreaRequest&,
                                           std::stop_token)>
      build;
};

class FakePipeline final : public tiler::TilePipeline {
 public:
  explicit FakePipeline(TileBuilder build, PointReader read_points = {}, AreaMesher mesher = {})
      : TilePipeline(std::vector<tiler::Dataset>()),
        build_(std::move(build)),
        read_points_(std::move(read_points)),
        mesher_(std::move(mesher)) {}

  Result<tiler::EncodedTile> Build(const tiler::TileRequest& request, std::stop_token stop) const override {
    return build_(request, std::move(stop));
  }
  Result<tiler::PointHeights> ReadPoints(std::uint32_t dataset, std::span<const dem::GeoPosition> points,
                                         dem::HeightDatum datum, std::stop_token stop) const override {
    Result<std::vector<float>> heights = read_points_(dataset, points, datum, std::move(stop));
    if (!heights) return tl::unexpected(std::move(heights).error());
    return tiler::PointHeights{*std::move(heights)};
  }
  Result<tiler::AreaPlan> PlanArea(std::uint32_t dataset, const tiler::AreaRequest& area, std::size_t) const override {
    return mesher_.plan(dataset, area);
  }
  Result<tiler::EncodedTile> BuildArea(std::uint32_t dataset, const tiler::AreaPlan& plan,
                                       const tiler::AreaRequest& area, std::stop_token stop) const override {
    return mesher_.build(dataset, plan, area, std::move(stop));
  }

 private:
  const TileBuilder build_;
  const PointReader read_points_;
  const AreaMesher mesher_;
};

}  // namespace terrace::server
