// The report of a flight as one HTML page: numbers, and plots and a map as SVG. The page needs no scripts and no other
// files.
#pragma once

#include <string>

#include "fly/report/requirement.h"
#include "fly/report/summary.h"

namespace terrace::fly {

std::string HtmlOf(const FlightOptions& options, const Summary& summary, const Judgements& judgements,
                   const FlightRecord& record);

}  // namespace terrace::fly
