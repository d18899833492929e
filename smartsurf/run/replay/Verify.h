// `smartsurf replay --verify`: runs a recorded experiment again and compares every recorded frame.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "smartsurf/record/Recording.h"

namespace smartsurf::run {

struct VerificationResult {
  std::uint64_t frames_compared = 0;
  std::uint64_t last_tick = 0;                        // of the last frame compared
  std::optional<std::uint64_t> first_different_tick;  // nullopt if all frames are identical
  // The first difference at that tick: the object, its recorded and its present state.
  std::string difference;
  bool interrupted = false;  // by `stop`
};

struct Allowed {
  bool unsafe = false;      // a script that was recorded with --unsafe may run
  bool extensions = false;  // the script may load the extensions that it names
};

// Runs the script text stored in the recording with the recorded options and seed; other files are read from
// their original paths. Actuator targets set by a controller are taken from the recording, so no controller
// runs. progress: called with the simulated time of each frame. Throws scene::InputError if the recording
// cannot be reproduced: the user intervened, the inputs were not recorded, the script is unsafe and not
// allowed, or an extension is missing or has other content.
VerificationResult verify(const record::Recording&, int threads, const Allowed&,
                          const std::atomic<bool>& stop, const std::function<void(double)>& progress);

}  // namespace smartsurf::run
