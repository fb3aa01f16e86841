// Opens a dataset from its configuration. Only this file converts a DatasetConfig to engine options.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>

#include "config/config.h"
#include "engine/core/result.h"
#include "engine/dem/elevation_model.h"
#include "tiler/tile_pipeline.h"

namespace terrace::cli {

// Opens all files of the dataset and reads their statistics, which are stored in `cache`. Errors name the file and the
// remedy. `fault`: dem::DemOptions. `only_cached`: dem::ElevationModel::OpenFromCache.
Result<std::unique_ptr<dem::ElevationModel>> OpenModel(
    const config::DatasetConfig& wanted, const dem::RasterCache& cache, const std::function<void(double)>& progress,
    std::stop_token stop = {}, std::function<void(const Error&)> fault = {}, bool only_cached = false);

// Makes a dataset from an open model, with its water mask and imagery. `version`: of this program. Tiles contain it,
// so a new version is a new generation.
Result<tiler::Dataset> MakeDataset(const config::DatasetConfig& wanted,
                                   std::shared_ptr<const dem::ElevationModel> model, const dem::RasterCache& cache,
                                   const std::string& version, std::stop_token stop = {});

// OpenModel, then MakeDataset, with its archive. Without sources: the archive alone.
Result<tiler::Dataset> OpenDataset(const config::DatasetConfig& wanted, const dem::RasterCache& cache,
                                   const std::string& version, const std::function<void(double)>& progress = {},
                                   std::stop_token stop = {});

// The same from statistics that `cache` has, without reading a raster. Nothing: it lacks some. All sources were checked
// then, but not edits, the water mask and the imagery, which need an open model.
Result<std::optional<tiler::Dataset>> OpenFromCache(const config::DatasetConfig& wanted, const dem::RasterCache& cache,
                                                    const std::string& version, const std::stop_token& stop);

}  // namespace terrace::cli
