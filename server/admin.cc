#include "server/admin.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <optional>
#include <stop_token>
#include <string_view>
#include <utility>

#include "server/api/tile_formats.h"
#include "server/handlers/handlers.h"
#include "server/http/http_error.h"
#include "server/http/text.h"
#include "server/query/mesh_query.h"
#include "server/telemetry/reply_record.h"
#include "tiler/store/tile_selection.h"

namespace terrace::server {
namespace {

constexpr std::string_view kPurgePath = "/admin/purge", kMetricsPath = "/metrics", kVersionPath = "/version";

struct Purge {
  std::string dataset, version;
  tiler::TileSelection selection;
};

Result<void> SetLevels(tiler::TileSelection& selection, std::string_view text) {
  const std::size_t dash = text.find('-');
  const auto first = PlainDecimal(text.substr(0, dash), /*max_digits=*/2);
  const auto last = dash == std::string_view::npos ? first : PlainDecimal(text.substr(dash + 1), /*max_digits=*/2);
  if (!first || !last || *first > *last || *last > geo::kMaxLevel) {
    return MakeError(ErrorCode::kInvalidArgument, "levels must be a level or two such as 8-13, 0 to {}",
                     geo::kMaxLevel);
  }
  selection.min_level = static_cast<int>(*first);
  selection.max_level = static_cast<int>(*last);
  return {};
}

// `dataset=NAME`, and optionally `bbox=west,south,east,north` and `levels=8` or `levels=8-13`. kNotFound: `catalog` has
// no such dataset. kInvalidArgument: the query is wrong. Messages are for the client.
Result<Purge> ParsePurge(std::string_view query, const Catalog& catalog) {
  constexpr std::array<const char*, 3> kNames = {"dataset", "bbox", "levels"};
  std::array<std::optional<std::string>, kNames.size()> values;
  const auto set = [&](std::size_t i, const std::string& value) -> Result<void> {
    values[i] = value;
    return {};
  };
  const Result<void> read = ReadParameters(query, kNames, set, {}, /*takes_version=*/false);
  if (!read) return tl::unexpected(read.error());
  const auto& [dataset, box, levels] = values;
  if (!dataset) return MakeError(ErrorCode::kInvalidArgument, "dataset is missing: name the one to purge");
  const Result<std::uint32_t> index = FindDataset(*dataset, catalog.datasets);
  if (!index) return tl::unexpected(index.error());
  const DatasetView& found = catalog.datasets[*index];
  Purge purge{found.name, found.version(), {}};
  purge.selection.generation = found.cache_generation;
  if (box) {
    const Result<dem::GeoBounds> bounds = ParseBox(*box);
    if (!bounds) return tl::unexpected(bounds.error());
    purge.selection.box = *bounds;
  }
  if (levels) {
    if (const Result<void> set = SetLevels(purge.selection, *levels); !set) return tl::unexpected(set.error());
  }
  return purge;
}

struct Purged {
  tiler::TileTiers::Erased tiles;
  tiler::RefinementCache::Erased refinements;
};

// Refinements first: tiles that are made from them meanwhile are erased, too.
Result<Purged> EraseAll(const AdminParts& parts, const tiler::TileSelection& selection, const std::stop_token& stop) {
  Result<tiler::RefinementCache::Erased> refinements;
  if (parts.refinements != nullptr) refinements = parts.refinements->Erase(selection, stop);
  Result<tiler::TileTiers::Erased> tiles = parts.tiles.Erase(selection, stop);
  if (!refinements) return tl::unexpected(std::move(refinements.error()));
  if (!tiles) return tl::unexpected(std::move(tiles.error()));
  return Purged{*std::move(tiles), *refinements};
}

// {"dataset":"maui","version":"0a1b2c3d4e5f","erased":{"tiles":{"memory":12,"archive":0,"disk":40},"refinements":{...}}}
std::string PurgedJson(const Purge& purge, const Purged& purged) {
  std::string stores;
  for (const auto& [name, count] : purged.tiles.stores) stores += fmt::format(",\"{}\":{}", name, count);
  return fmt::format(
      R"({{"dataset":"{}","version":"{}","erased":{{"tiles":{{"memory":{}{}}},"refinements":{{"memory":{},"disk":{}}}}}}})"
      "\n",
      purge.dataset, purge.version, purged.tiles.memory, stores, purged.refinements.memory, purged.refinements.below);
}

}  // namespace

// Serves one connection.
class AdminApplication::Handler final : public ConnectionHandler {
 public:
  explicit Handler(const AdminParts& parts) : parts_(parts) {}

  Admission Admit(Request& request, std::chrono::milliseconds /*longest_wait*/) override {
    Admission admission;
    admission.refusal = Refuse(request);
    if (PathOf(request) == kPurgePath)
      admission.body_remedy = "parameters belong into the URL: /admin/purge?dataset=NAME";
    return admission;
  }

  Answer Handle(const Request& request) override {
    if (PathOf(request) == kPurgePath) return AnswerPurge(request);
    if (PathOf(request) == kVersionPath) {
      return StateResponse(200, "application/json",
                           std::make_shared<const std::string>(VersionJson(*parts_.catalog())));
    }
    return WriteMetrics();
  }

  void Report(const SentReply& reply) override {
    ReplyRecord record = RecordOf(reply);
    record.route = "admin";
    record.cache = "-";
    record.error = "";  // of a cache: no source was read
    parts_.metrics.CountReply(record);
    parts_.access_log.Write(record);
  }

 private:
  static std::string_view PathOf(const Request& request) {
    return std::string_view(request.target).substr(0, request.target.find('?'));
  }
  static std::string_view QueryOf(const Request& request) {
    const std::size_t path = PathOf(request).size();
    return std::string_view(request.target).substr(std::min(path + 1, request.target.size()));
  }

  static std::optional<Response> Refuse(const Request& request) {
    if (!request.fields->origin.empty()) return ProblemResponse(403, "web pages are not answered here", request.id);
    const std::string_view path = PathOf(request);
    const bool is_purge = path == kPurgePath;
    if (!is_purge && path != kMetricsPath && path != kVersionPath) {
      return ProblemResponse(404, "no such URL; there are /admin/purge, /metrics and /version", request.id);
    }
    const bool reads = request.method == Method::kGet || request.method == Method::kHead;
    if (is_purge ? request.method == Method::kPost : reads) return std::nullopt;
    Response response =
        ProblemResponse(405, is_purge ? "only POST is answered here" : "only GET is answered here", request.id);
    response.headers.emplace_back("Allow", is_purge ? "POST" : "GET, HEAD");
    response.close = true;  // a body of any form may follow
    return response;
  }

  asio::awaitable<Response> WriteMetrics() {
    co_return StateResponse(200, kMetricsType, co_await parts_.metrics_page.Get());
  }

  asio::awaitable<Response> AnswerPurge(const Request& request) {
    const Result<Purge> purge = ParsePurge(QueryOf(request), *parts_.catalog());
    if (!purge) co_return ClientErrorResponse(purge.error(), request.id);
    // The worker writes the log, because the client may have left by then.
    Work<std::string> work = [&parts = parts_, purge = *purge](const std::stop_token& stop) -> Result<std::string> {
      const Result<Purged> purged = EraseAll(parts, purge.selection, stop);
      if (!purged) {
        spdlog::warn("purge of {}: {}; tiles may be left", purge.dataset, purged.error().message);
        return tl::unexpected(purged.error());
      }
      std::string text = PurgedJson(purge, *purged);
      spdlog::info("purge: {}", Trim(text, "\n"));
      return text;
    };
    const JobTerms terms = LongTerms(request.deadline, /*client=*/0);
    Result<std::string> text = co_await parts_.workers.Run(std::move(work), terms);
    if (!text) co_return co_await DelayedBackendError(text.error(), request.id);
    co_return StateResponse(200, "application/json", std::make_shared<const std::string>(*std::move(text)));
  }

  const AdminParts& parts_;
};

std::unique_ptr<ConnectionHandler> AdminApplication::Connect(const asio::ip::address& /*peer*/) {
  return std::make_unique<Handler>(parts_);
}

}  // namespace terrace::server
