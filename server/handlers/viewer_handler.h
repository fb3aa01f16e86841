// GET /, /viewer/{file} and /datasets: the viewer and the list of datasets.
#pragma once

#include <memory>
#include <span>
#include <stop_token>
#include <string>

#include "server/api/call.h"
#include "server/documents/document.h"
#include "server/documents/document_maker.h"
#include "server/documents/static_files.h"
#include "server/handlers/datasets_handler.h"
#include "server/tiles/dataset_view.h"

namespace terrace::server {

class ViewerHandler {
 public:
  // `datasets` must outlive this.
  ViewerHandler(std::span<const DatasetView> datasets, std::shared_ptr<const StaticFiles> files);

  // The list of datasets that the request may see.
  Described Datasets(const Call& call) const;

  // A file of the viewer. Without a viewer, `/` is a plain list of datasets.
  Described File(const Call& call) const;

 private:
  using WriteDatasets = std::string (*)(std::span<const DatasetView>, const IsSeen&, const std::stop_token&);
  DocumentPlan PlanOfSeen(const Document& all, const Call& call, WriteDatasets write) const;

  const std::span<const DatasetView> datasets_;
  const std::shared_ptr<const StaticFiles> files_;
  const Document list_;   // of all datasets
  const Document index_;  // for `/` without a viewer
};

}  // namespace terrace::server
