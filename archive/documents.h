// The documents that describe an archive to programs that read it without a server.
#pragma once

#include <string>

#include "archive/manifest.h"
#include "engine/common/dem_types.h"

namespace terrace::archive {

// layer.json of an archive of terrain tiles. Equal to the server's except for the version, if the whole dataset was
// baked with all extensions.
std::string LayerJson(const Manifest& manifest);

// The bounds of the deepest height tiles of an archive, within those of the dataset.
dem::GeoBounds HeightTileBounds(const Manifest& manifest);

// TileJSON of an archive of height tiles, with a template relative to itself.
std::string TileJson(const Manifest& manifest);

// The metadata of an archive in one file (WriteSingle of export.h): layer.json or TileJSON, with the manifest as member
// kManifestMember.
std::string SingleMetadata(const Manifest& manifest);

}  // namespace terrace::archive
