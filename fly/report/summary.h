// A flight in numbers, for people and programs.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "fly/flight/flight.h"
#include "fly/flight/statistics.h"

namespace terrace::fly {

struct Summary {
  Totals totals;
  std::vector<ClientRecord> clients;
  double seconds = 0;                                 // of the whole run
  int never_opened = 0, never_full = 0;               // clients
  double first_view_s = -1, worst_first_view_s = -1;  // median and worst of all clients; -1: never
  double arrival_s = -1;  // worst; -1: a client that opened the document had none after its flight
  // How long tiles were waited for; -1: never arrived, as tiles that failed. A tile that is still awaited at the end
  // counts with its wait so far if that exceeds the percentile of the others.
  double p50_s = 0, p99_s = 0, max_s = 0;
  double tiles_per_second = 0;       // mean over the seconds in which tiles arrived, were wanted or in flight
  double best_tiles_per_second = 0;  // in the best second
  double refined_share = 0;          // of the frames of the flight
  double frame_p50_px = -1, frame_p99_px = -1;  // percentiles of the frames' worst errors; -1: not measured
  bool is_beside_data = false;        // no frame of the flight saw more than level 0, though it asked for more
  std::uint64_t errors = 0;           // requests that did not end with ok or a refusal
  std::vector<std::string> findings;  // what is wrong, in sentences
};

struct Judgements;  // requirement.h

Summary Summarize(const FlightOptions& options, const FlightRecord& record);

// Lines for a terminal.
std::string TextOf(const Summary& summary);

// One line about second `i` of the flight.
std::string LineOf(std::size_t i, const Second& second);

// One JSON object: {"document": .., "summary": {..}, "requirements": [..], "seconds": [..]}.
std::string JsonOf(const FlightOptions& options, const Summary& summary, const Judgements& judgements,
                   const std::vector<Second>& seconds);

}  // namespace terrace::fly
