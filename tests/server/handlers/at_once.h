// What handlers answer, with documents made in place.
#pragma once

#include <utility>

#include "server/handlers/document_maker.h"
#include "server/http/negotiate.h"

namespace terrace::server {

inline Response AtOnce(Answer answer, const Request& request) {
  const auto* plan = std::get_if<DocumentPlan>(&answer);
  if (plan == nullptr) return std::get<Response>(std::move(answer));
  const tiler::Coding coding = NegotiateCoding(request.fields->accept_encoding, tiler::kGzipOnly);
  return Serve(*MakeDocument(plan->write, coding, {}), *plan, request);
}

}  // namespace terrace::server
