// Where a baker takes its units from: its own list, or a queue that many bakers share.
#pragma once

#include <cstddef>

#include "engine/core/result.h"

namespace terrace::bake {

// Hands out the units of a plan by their indexes. A unit that was handed out is given back with Done, Return or Fail.
// Thread-safe.
class UnitQueue {
 public:
  struct Taken {
    enum class State {
      kUnit,
      kWait,  // none now: others are being baked, and may be handed out again
      kOver,  // none is left
    };
    State state = State::kOver;
    std::size_t unit = 0;
    int attempt = 0;  // earlier attempts that failed; in a shared queue also those whose worker was lost
  };

  virtual ~UnitQueue() = default;

  // Does not wait for units.
  virtual Taken Take() = 0;
  // The unit is done: its files are written.
  virtual void Done(std::size_t unit) = 0;
  // Gives back a unit that was not baked because the bake was stopped.
  virtual void Return(std::size_t unit) = 0;
  // The unit could not be baked. True: it will be handed out again. False: it is given up.
  virtual bool Fail(std::size_t unit, const Error& why) = 0;
};

// A unit is given up after this many failed attempts. LocalQueue gives it up one attempt earlier if a source has
// changed (kChanged).
inline constexpr int kMaxAttempts = 3;

}  // namespace terrace::bake
