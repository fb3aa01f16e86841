#include "server/handlers/handlers.h"

#include <utility>

namespace terrace::server {
namespace {

std::string_view OriginHeaders(const config::Config& config) {
  if (config.trusted_proxies.empty()) return {};
  return config.forwarded_header == config::ForwardedHeader::kForwarded ? "Forwarded"
                                                                        : "X-Forwarded-Host, X-Forwarded-Proto";
}

std::vector<HandlerState::DatasetDocuments> MakeDatasetDocuments(const std::vector<DatasetView>& datasets) {
  std::vector<HandlerState::DatasetDocuments> made(datasets.size());
  for (std::size_t i = 0; i < datasets.size(); ++i) {
    made[i].layer = PlainLayer(datasets[i]);
    AddTileset(datasets[i], made[i]);
  }
  return made;
}

}  // namespace

HandlerState::HandlerState(CatalogPtr c, WorkerPool& w, TileService& t, DocumentFlights& document_flights,
                           std::shared_ptr<const StaticFiles> v, const config::Config& config, const ServerStatus& p)
    : catalog(std::move(c)),
      workers(w),
      tiles(t),
      process(p),
      viewer(std::move(v)),
      cache_control(config.cache_control),
      origin_headers(OriginHeaders(config)),
      max_locations(config.max_locations),
      max_mesh_samples(config.max_mesh_samples),
      dataset_documents(MakeDatasetDocuments(catalog->datasets)),
      list(Document::Make(DatasetsJson(catalog->datasets), "application/json")),
      index(Document::Make(IndexHtml(catalog->datasets), "text/html; charset=utf-8")),
      documents(catalog, document_flights) {}

}  // namespace terrace::server
