// Opens the archive of a dataset.
#pragma once

#include <string>

#include "config/config.h"
#include "engine/core/result.h"
#include "tiler/tile_pipeline.h"

namespace terrace::cli {

// Adds the dataset's archive, if the configuration names one. An archive that cannot be opened or is of another version
// is not used; the log says why, and baked_files tell when to try again. Precondition: all other members of `dataset`
// are set.
void AddBaked(const config::DatasetConfig& wanted, tiler::Dataset& dataset);

// Makes a dataset without sources, from its archive alone. Errors name the place and the remedy.
Result<tiler::Dataset> OpenBakedAlone(const config::DatasetConfig& wanted);

// Whether `path` is an archive: a folder with a manifest, or a .pmtiles file.
bool IsArchive(const std::string& path);
// The name of the dataset that was baked.
Result<std::string> NameOfBaked(const std::string& place);

}  // namespace terrace::cli
