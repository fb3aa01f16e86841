// The report of a flight as one HTML page: numbers, plots and a map as SVG, without scripts or other files.
#pragma once

#include <string>

#include "fly/report/requirement.h"
#include "fly/report/summary.h"

namespace terrace::fly {

std::string HtmlOf(const FlightOptions& options, const Summary& summary, const Judgements& judgements,
                   const Statistics& statistics);

}  // namespace terrace::fly
