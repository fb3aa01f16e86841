// The table of options of one dataset.
#include "config/options/option_table.h"
#include "proto/gltf/gltf_names.h"

namespace terrace::config {
namespace {

// Names that are valid in URLs, except the server's own.
Json NameSchema() {
  Json taken = Json::array({".", ".."});
  for (const std::string_view name : ReservedDatasetNames()) taken.push_back(name);
  return {{"type", "string"}, {"pattern", kNamePattern}, {"not", {{"enum", std::move(taken)}}}};
}

}  // namespace

const std::vector<Option<DatasetConfig>>& DatasetOptionTable() {
  static const std::vector<Option<DatasetConfig>> table = {
      {.key = "name",
       .value = "NAME",
       .help = "Name of the dataset in URLs; by default the name of the file without its extension",
       .details = "1 to 64 letters, digits, `.`, `_` or `-`; not `.`, `..`, `datasets`, `viewer`, `livez`, `readyz`, "
                  "`metrics`, `version` or `openapi.json`. A DEM on the command line is named after its file; other "
                  "characters become `-`",
       .codec = Text(&DatasetConfig::name, CheckDatasetName, NameSchema()),
       .other_words = "id title",
       .missing = "; every dataset needs one"},
      {.key = "sources",
       .help = "Files, globs and folders of rasters, in order of priority",
       .details = "At each place, the first source that has a height is used: [mosaics](#mosaics). Globs have `*`, `?` "
                  "and `[...]`. A folder stands for all rasters in it, without its subfolders. Relative to the folder "
                  "of the file. Each entry is a text, or an object such as `{\"path\": \"srtm/\", \"vertical\": "
                  "\"egm96\", \"nodata\": -9999}` with options that differ from the dataset's",
       .codec = SourcesCodec(),
       .other_words = "paths file files dem dems raster rasters input inputs",
       .missing = "; every dataset needs one, or \"baked\"",
       .unless = "baked"},
      {.key = "edits",
       .value = "FILE,...",
       .help =
           "GeoJSON files whose features edit the terrain: flatten, slope, offset, carve, holes, precision and others",
       .details = "Later features lie over earlier ones. Relative to the folder of the file. They are watched like "
                  "sources. [Edits](edits.md)",
       .codec = TextList(&DatasetConfig::edits, "a list of GeoJSON files", true),
       .other_words = "geojson features overrides modifications patches"},
      {.key = "baked",
       .value = "PLACE",
       .help = "Archive with finished tiles of this dataset; other tiles are built from the sources",
       .details =
           "What `terrace bake` wrote: a folder, relative to the folder of the file, or a `.pmtiles` file. Used if "
           "its version is that of the dataset; else the log says so, and tiles are built. Without `sources` "
           "the archive alone is served. [More](formats/archive.md)",
       .codec = Path(&DatasetConfig::baked, "the path of an archive"),
       .other_words = "archive archives pmtiles tiles prebuilt"},
      {.key = "vertical",
       .value = "DATUM",
       .help =
           "Vertical datum of the heights: crs (as the source states), unknown, ellipsoid, egm96, egm2008, EPSG:N or "
           "the path of a grid",
       .details = "`EPSG:5703` is an example of a vertical reference system. A grid of undulations is a path (`.gtx`, "
                  "`.tif`), relative to the folder of the file. [More](#heights)",
       .codec = VerticalCodec(),
       .other_words = "datum geoid"},
      {.key = "nodata",
       .value = "VALUE",
       .help = "Which samples are voids: auto (declared and detected nodata values), declared, or a number (declared "
               "values and this one)",
       .details = "`auto` also detects undeclared values. A number or a list of numbers (raw values) adds them to the "
                  "declared value. [More](#voids)",
       .codec = NodataCodec()},
      {.key = "attribution",
       .value = "TEXT",
       .help = "Attribution shown by clients",
       .details =
           "One line of text or HTML, such as a link to the license. Clients take it as HTML, so `<` and `&` are "
           "written `&lt;` and `&amp;`",
       .codec = OneLine(&DatasetConfig::attribution),
       .other_words = "copyright credit credits license licence"},
      {.key = "error_fraction",
       .value = "SHARE",
       .help = "Default error of a level as a fraction of the error that clients assume there",
       .details = "They assume 77,067 m / 2^level",
       .codec = Number(&DatasetConfig::error_fraction, 0.05, 1),
       .other_words = "max_error"},
      {.key = "finest_error",
       .value = "METRES",
       .help = "The deepest level is the first whose default error is at most this; by default a tenth of the source's "
               "sample "
               "spacing",
       .details = "The spacing is that of the finest source",
       .codec = Number(&DatasetConfig::finest_error, 0.001, 100'000),
       .other_words = "max_error tolerance resolution"},
      {.key = "floor",
       .value = "METRES",
       .help =
           "Height outside the sources and in voids that are not filled; by default the lowest height of the sources",
       .details =
           "Above the WGS 84 ellipsoid. Where heights are converted from a geoid, the default may be some metres "
           "below the lowest height; `terrace info` prints it",
       .codec = Number(&DatasetConfig::floor, -kMaxHeight, kMaxHeight)},
      {.key = "max_void_gap",
       .value = "SAMPLES",
       .help = "Voids narrower than this many source samples are filled from their edges",
       .codec = Integer(&DatasetConfig::max_void_gap, 0, 4096)},
      {.key = "voids",
       .value = "NAME",
       .help =
           "Surface in larger voids with data all around them: smooth (between the heights at their edges) or floor",
       .details = "It applies where no other source has a height. [More](#voids)",
       .codec = Choice(&DatasetConfig::voids, {{"smooth", dem::HoleFill::kSmooth}, {"floor", dem::HoleFill::kFloor}}),
       .other_words = "holes"},
      {.key = "feather",
       .value = "METRES",
       .help = "Distance from edges and voids over which a source blends into the sources below; 0 is a hard edge",
       .details = "At most 256 samples of the source, or of the averages that a level is read from. [More](#mosaics)",
       .codec = Number(&DatasetConfig::feather, 0, 1'000'000),
       .other_words = "blend blending"},
      {.key = "criterion",
       .value = "NAME",
       .help = "How triangles are connected: delaunay, or data-dependent (smaller tiles that take longer to build)",
       .details =
           "`delaunay` avoids thin triangles. `data-dependent` fits triangles to the heights: an eighth to a fifth "
           "fewer vertices within the same error, but thinner triangles and about twice the time to refine",
       .codec = Choice(&DatasetConfig::criterion,
                       {{"delaunay", tin::Criterion::kDelaunay}, {"data-dependent", tin::Criterion::kDataDependent}})},
      {.key = "compact",
       .value = "true|false",
       .help = "Remove the vertices that a tile's error does not need: smaller tiles that take longer to build",
       .details = "About a third fewer vertices within the same error, and 34 to 52 % fewer bytes. A tile takes about "
                  "a tenth longer to build; another error of a tile whose refinement is in the cache takes a quarter "
                  "longer. Edges do not change. Heights stay within the error but use more of it. [Decision "
                  "18](decisions/0018-compact-stays-an-option.md) says when it is worth it",
       .codec = Switch(&DatasetConfig::compact)},
      {.key = "glb_compression",
       .value = "NAME",
       .help = "Compression of GLB tiles whose requests do not name one: draco, none, quantized or meshopt",
       .details = "[Which client reads which](formats/glb.md#compression)",
       .codec = Choice(&DatasetConfig::glb_compression, proto::kGlbCompressionNames)},
      {.key = "draco_speed",
       .value = "N",
       .help = "Speed of Draco for GLB tiles: 0 makes the smallest tiles, 10 is fastest",
       .details = "3 makes large tiles 8 % smaller, and encoding takes half as long again or more. 10 encodes each "
                  "triangle separately, and tiles are 2.5 to 3 times as large",
       .codec = Integer(&DatasetConfig::draco_speed, 0, 10)},
      {.key = "draco_normal_bits",
       .value = "N",
       .help = "Bits of each of the two coordinates of a normal in Draco tiles",
       .details = "With 8 bits, as in quantized-mesh, a normal is less than a degree off",
       .codec = Integer(&DatasetConfig::draco_normal_bits, 4, 16)},
      {.key = "water",
       .value = "METRES|FILE",
       .help = "Water masks: a sea level, or a raster that is not zero on water",
       .details = "Tiles have a mask if the client requests it. In the file, `{\"sea_level\": 0}` is a height in "
                  "metres, -20,000 to 20,000; heights of the dataset at or below it are water. `{\"mask\": "
                  "\"water.tif\"}` is a raster, relative to the folder of the file. As a flag, a number is a sea level "
                  "and other text a raster. [More](#water)",
       .codec = WaterCodec()},
      {.key = "imagery",
       .value = "FILE",
       .help = "Image for imagery tiles and for the textures of GLB tiles",
       .details = "In the file `{\"image\": \"photo.tif\"}`, relative to its folder; as a flag the path alone. "
                  "[More](#imagery)",
       .codec = ImageryCodec(),
       .other_words = "photo ortho orthophoto"},
      {.key = "public",
       .value = "true|false",
       .help = "Serve the dataset without a token, if the server has tokens",
       .details = "A change needs a restart. [More](#tokens)",
       .codec = Switch(&DatasetConfig::is_public),
       .other_words = "open anonymous"},
      {.key = "metadata_availability",
       .value = "LEVELS",
       .help = "Every so many levels, tiles list the tiles below them; 0 is none",
       .details = "With 0, only `layer.json` tells clients which tiles exist. [More](#where-tiles-are)",
       .codec = Integer(&DatasetConfig::metadata_availability, 0, 24)},
  };
  return table;
}

}  // namespace terrace::config
