// What handlers of documents answer, with documents made in place.
#pragma once

#include <utility>

#include "server/api/negotiate.h"
#include "server/documents/document_maker.h"
#include "tests/server/test_call.h"

namespace terrace::server {

inline Response AtOnce(Described described, const Request& request) {
  const auto* plan = std::get_if<DocumentPlan>(&described);
  if (plan == nullptr) return std::get<Response>(std::move(described));
  const tiler::Coding coding = NegotiateCoding(request.fields->accept_encoding, tiler::kGzipOnly);
  return Serve(*MakeDocument(plan->write, coding, {}), *plan, request);
}

}  // namespace terrace::server
