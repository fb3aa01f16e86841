#include "server/openapi/operations.h"

namespace terrace::server {
namespace {

const std::vector<std::string_view> kStateHeaders = {"Cache-Control"};
const std::vector<MediaNote> kPlainText = {{"text/plain; charset=utf-8"}};

}  // namespace

const Operation kLiveOperation{.id = "getLive",
                               .tag = "monitoring",
                               .summary = "Liveness",
                               .description = "`ok` as long as the process answers.",
                               .replies = kPlainText,
                               .headers = kStateHeaders,
                               .examples = {{"/livez"}}};

const Operation kReadyOperation{
    .id = "getReady",
    .tag = "monitoring",
    .summary = "Readiness",
    .description =
        "`ready`, or `degraded` if a changed source or configuration cannot be loaded, if a dataset is still being "
        "reopened after 10 s, if a source is not stored in `cache_dir`, if files of a dataset that is an archive alone "
        "are missing, or while a dataset is being prepared and others are served. 503: `opening` while the server "
        "starts or prepares all that it has, `draining` while it stops.",
    .replies = kPlainText,
    .unavailable = kPlainText,
    .headers = kStateHeaders,
    .examples = {{"/readyz"}}};

const Operation kMetricsOperation{.id = "getMetrics",
                                  .tag = "monitoring",
                                  .summary = "Metrics in Prometheus text format",
                                  .description = "With tokens only for those that see all datasets.",
                                  .replies = {{"text/plain; version=0.0.4; charset=utf-8"}},
                                  .headers = kStateHeaders,
                                  .examples = {{"/metrics"}}};

const Operation kVersionOperation{.id = "getVersion",
                                  .tag = "monitoring",
                                  .summary = "Versions of the program, of its libraries and of the datasets",
                                  .description = "With tokens only for those that see all datasets.",
                                  .replies = {{"application/json", "Version"}},
                                  .headers = kStateHeaders,
                                  .examples = {{"/version"}}};

}  // namespace terrace::server
