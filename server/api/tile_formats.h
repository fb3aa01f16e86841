// The tile formats, one row for each suffix of their URLs: parameters, and headers of replies. A format for pictures
// has several suffixes. Also what all formats share: the coding of a reply. tiler/encoders.h has the encoders.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/core/result.h"
#include "proto/documents/picture_types.h"
#include "proto/media_type.h"
#include "server/api/request_context.h"
#include "server/tiles/catalog.h"
#include "tiler/tile/encoded_tile.h"
#include "tiler/tile/tile_request.h"

namespace terrace::server {

struct TileFormatRow {
  tiler::TileFormat format;
  std::string_view folder;  // of the URL, between the dataset and the level: "hillshade"; empty: none
  std::string_view suffix;  // of the URL: ".terrain"
  std::string_view (*media_type)(const tiler::TileRequest& tile);
  std::string_view (*vary)(const tiler::TileRequest& tile);  // the headers that a reply depends on, as in Response
  // Reads the parameters of a URL into the request. The caller has set its key, its format, and for pictures
  // map.picture. kNotFound: the dataset has no such tile. kInvalidArgument: that of the parser in server/query; for
  // contours also an interval below tiler::MinIntervalCm.
  Result<void> (*read)(std::string_view query, const RequestFields& fields, const DatasetView& dataset,
                       tiler::TileRequest& tile);
  proto::PictureFormat picture = proto::PictureFormat::kPng;  // of pictures for maps
  const Operation* operation = nullptr;                       // what /openapi.json says about its URLs

  bool is_mercator() const { return tiler::IsMercator(format); }
};

// All formats.
std::span<const TileFormatRow> TileFormatRows();

// Removes the suffix of a tile's URL from its last segment, and returns the row of the format in a folder; null if no
// suffix matches.
const TileFormatRow* TakeFormat(std::string_view& name, std::string_view folder = {});

// The first row of a format in a folder; null if there is none. TileJSON documents use its suffix by default.
const TileFormatRow* FirstFormatIn(std::string_view folder);
// The row of a tile format whose pictures are files of type `picture`; null if there is none.
const TileFormatRow* FormatWith(tiler::TileFormat format, proto::PictureFormat picture);

// Returns the canonical request for a route and a request's headers. kNotFound: no such dataset, or the tile lies
// outside what the dataset has. Errors of TileFormatRow::read. Precondition: the route has a format.
Result<tiler::TileRequest> NegotiateTile(const RequestContext& context, std::span<const DatasetView> datasets);

// kNotFound: the dataset has no sources and its archive has no tiles of this format; or the format is in Web Mercator
// and the dataset, or its image for kImagery, lies beyond the latitudes of that projection.
Result<void> CheckHasFormat(const DatasetView& dataset, tiler::TileFormat format);

// Checks that an archive has the tiles of this format that `query` asks for: a document that appends `query` to its
// URLs must not link to absent tiles. Datasets with sources have them all. kNotFound: some level lacks them. Errors of
// TileFormatRow::read.
Result<void> CheckHasQueriedTiles(const DatasetView& dataset, tiler::TileFormat format, std::string_view query);

// The dataset's index, or kNotFound.
Result<std::uint32_t> FindDataset(std::string_view name, std::span<const DatasetView> datasets);

// The coding in `offered` with the highest quality in Accept-Encoding; among equals the first. Identity only if the
// header names it with a higher quality, or accepts none of the others.
tiler::Coding NegotiateCoding(std::string_view accept_encoding,
                              std::span<const tiler::Coding> offered = tiler::kCodings);

// The extensions named by `extensions=a-b` parameters anywhere in Accept and by the query's values. Unknown names are
// ignored. 3DTilesRendererJS adds the parameter to application/octet-stream.
proto::TileExtensions WantedExtensions(std::string_view accept, const std::vector<std::string>& query_extensions);

// The header lines of a reply that describe its tile, written once and kept with the tile: Content-Type,
// Content-Encoding and Content-Length; ETag, Terrain-Max-Error and Terrain-Certified-Error. `tile` is the tile of
// `request`.
tiler::HeaderLines MakeTileHeaders(const tiler::TileRequest& request, const tiler::EncodedTile& tile);

}  // namespace terrace::server
