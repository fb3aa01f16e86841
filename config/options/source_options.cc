#include <algorithm>
#include <array>
#include <filesystem>

#include "config/input/source_paths.h"
#include "config/options/option_table.h"

namespace terrace::config {
namespace {

constexpr const char* kVerticalExpected =
    "\"crs\", \"unknown\", \"ellipsoid\", \"egm96\", \"egm2008\", a vertical reference system such as \"EPSG:5703\", "
    "or the "
    "path of a grid (.gtx, .tif)";
constexpr const char* kNodataExpected = "\"auto\", \"declared\", a number or a list of numbers";

bool IsGrid(const std::string& text) {
  const std::string extension = std::filesystem::path(text).extension().string();
  return extension == ".gtx" || extension == ".tif" || extension == ".tiff";
}

bool IsVerticalName(const std::string& text) {
  constexpr std::array<std::string_view, 5> kWords = {"crs", "unknown", "ellipsoid", "egm96", "egm2008"};
  if (std::find(kWords.begin(), kWords.end(), text) != kWords.end()) return true;
  constexpr std::string_view kEpsg = "EPSG:";
  return text.starts_with(kEpsg) && text.size() > kEpsg.size() && text.size() < kEpsg.size() + 7 &&
         text.find_first_not_of("0123456789", kEpsg.size()) == std::string::npos;
}

// Returns nothing, after reporting an error, if the value is invalid.
std::optional<std::string> ReadVertical(const Json& value, const ConfigLocation& place) {
  const std::string text = value.is_string() ? value.get<std::string>() : "";
  if (IsVerticalName(text)) return text;
  if (IsGrid(text) && !HasControlCharacter(text)) return place.Resolve(text);
  place.Expected(kVerticalExpected);
  return std::nullopt;
}

std::optional<NodataConfig> ReadNodata(const Json& value, const ConfigLocation& place) {
  if (value == "auto") return NodataConfig{};
  NodataConfig nodata{false, {}};
  if (value == "declared") return nodata;
  const Json list = value.is_array() ? value : Json::array({value});
  for (const Json& number : list) {
    if (!number.is_number()) {
      place.Expected(kNodataExpected);
      return std::nullopt;
    }
    nodata.values.push_back(number.get<double>());
  }
  return nodata;
}

Json WriteNodata(const NodataConfig& nodata) {
  if (nodata.detect) return "auto";
  if (nodata.values.empty()) return "declared";
  if (nodata.values.size() == 1) return NumberOut(nodata.values.front());
  Json list = Json::array();
  for (const double value : nodata.values) list.push_back(NumberOut(value));
  return list;
}

Codec<SourceConfig> SourcePath() {
  return {[](const Json& value, const ConfigLocation& place, SourceConfig& source) {
            if (!value.is_string() || value.get_ref<const std::string&>().empty()) {
              return place.Expected("a path, a glob or a folder");
            }
            // The system would read the path only up to the character, and so open another file.
            if (value.get_ref<const std::string&>().find('\0') != std::string::npos) {
              return place.Fail("has the character \\u0000, which no path has; remove it");
            }
            source.path = value.get<std::string>();
          },
          [](const SourceConfig& source) { return Json(source.path); }, nullptr, Json::parse(kNonEmptyText)};
}

constexpr const char* kVerticalSchema = R"({
  "anyOf": [
    {"enum": ["crs", "unknown", "ellipsoid", "egm96", "egm2008"]},
    {"type": "string", "pattern": "^EPSG:[0-9]{1,6}$"},
    {"type": "string", "pattern": "^[^\\u0000-\\u001f\\u007f]*\\.(gtx|tif|tiff)$"}
  ]
})";
constexpr const char* kNodataSchema = R"({
  "anyOf": [{"enum": ["auto", "declared"]}, {"type": "number"}, {"type": "array", "items": {"type": "number"}}]
})";

template <typename Target, typename Member>
Codec<Target> Vertical(Member Target::*member) {
  return {[=](const Json& value, const ConfigLocation& place, Target& target) {
            if (auto vertical = ReadVertical(value, place)) target.*member = *std::move(vertical);
          },
          [=](const Target& target) {
            const std::optional<std::string> vertical = target.*member;
            return vertical ? Json(*vertical) : Json();
          },
          TextToJson, Json::parse(kVerticalSchema)};
}

template <typename Target, typename Member>
Codec<Target> Nodata(Member Target::*member) {
  return {[=](const Json& value, const ConfigLocation& place, Target& target) {
            if (auto nodata = ReadNodata(value, place)) target.*member = *std::move(nodata);
          },
          [=](const Target& target) {
            const std::optional<NodataConfig> nodata = target.*member;
            return nodata ? WriteNodata(*nodata) : Json();
          },
          NumberToJson, Json::parse(kNodataSchema)};
}

void ReadSource(const Json& value, const ConfigLocation& place, DatasetConfig& dataset) {
  SourceConfig source;
  const bool is_object = value.is_object();
  if (!is_object) {
    SourcePath().read(value, place, source);
  } else {
    ReadObject(value, place, SourceOptionTable(), source);
  }
  if (source.path.empty()) return;
  Result<SourceConfig> expanded = ExpandSource(source.path, place.directory());
  if (!expanded) {
    return (is_object ? place.At("path") : place)
        .Fail(expanded.error().message + "; correct the path; a relative path starts at " + place.directory().string());
  }
  expanded->vertical = std::move(source.vertical);
  expanded->nodata = std::move(source.nodata);
  dataset.sources.push_back(*std::move(expanded));
}

Json SourcesSchema() {
  Json schema = ListOf({{"anyOf", Json::array({Json::parse(kNonEmptyText), ObjectSchema(SourceOptionTable())})}});
  schema["minItems"] = 1;
  return schema;
}

}  // namespace

const std::vector<Option<SourceConfig>>& SourceOptionTable() {
  static const std::vector<Option<SourceConfig>> table = {
      {.key = "path",
       .value = "PATH",
       .help = "A file, a glob or a folder",
       .codec = SourcePath(),
       .missing = ": a path, a glob or a folder"},
      {.key = "vertical",
       .value = "DATUM",
       .help = "Vertical datum of these files; by default the dataset's",
       .codec = Vertical(&SourceConfig::vertical)},
      {.key = "nodata",
       .value = "VALUE",
       .help = "Which samples of these files are voids; by default as for the dataset",
       .codec = Nodata(&SourceConfig::nodata)},
  };
  return table;
}

Codec<DatasetConfig> SourcesCodec() {
  return {[](const Json& value, const ConfigLocation& place, DatasetConfig& dataset) {
            if (!value.is_array() || value.empty()) {
              return place.Expected("a list of paths such as [\"lidar/*.tif\", \"base.tif\"]");
            }
            for (std::size_t i = 0; i < value.size(); ++i) ReadSource(value[i], place.At(i), dataset);
          },
          [](const DatasetConfig& dataset) {
            if (dataset.sources.empty() && !dataset.baked.empty()) return Json();
            Json list = Json::array();
            for (const SourceConfig& source : dataset.sources) {
              const bool is_plain = !source.vertical && !source.nodata;
              list.push_back(is_plain ? Json(source.path) : WriteObject(source, SourceOptionTable()));
            }
            return list;
          },
          nullptr, SourcesSchema()};
}

Codec<DatasetConfig> VerticalCodec() { return Vertical(&DatasetConfig::vertical); }
Codec<DatasetConfig> NodataCodec() { return Nodata(&DatasetConfig::nodata); }

}  // namespace terrace::config
