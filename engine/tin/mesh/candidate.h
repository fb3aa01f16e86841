// A sample that may become a vertex, and the order in which samples are inserted.
#pragma once

#include <cstdint>

namespace terrace::tin {

inline constexpr std::uint32_t kNoSample = 0xFFFFFFFF;

// The default value means "no candidate". Every real candidate precedes it.
struct Candidate {
  double error = 0;                  // metres, weighted; > 0 unless there is none
  std::uint32_t sample = kNoSample;  // its number (SampleNumber)

  // The order of the samples of one triangle: larger error first, then smaller number. The order of insertions is that
  // of CandidateQueue, which rounds errors up to floats.
  friend constexpr bool Precedes(const Candidate& a, const Candidate& b) {
    return a.error > b.error || (a.error == b.error && a.sample < b.sample);
  }
  friend bool operator==(const Candidate&, const Candidate&) = default;
};

}  // namespace terrace::tin
