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
  std::uint64_t frames_compared = 0;  // compared
  std::uint64_t last_tick = 0;        // of the last one
  std::optional<std::uint64_t> first_different_tick;
  std::string difference;  // what differs first there: the object and its recorded and present state
  bool interrupted = false;
};

// The experiment is the text that the recording holds, with its options and seed; its companion files are
// read where they were. What a controller told the actuators is taken from the recording, so no controller
// runs. unsafe: allow a script that was recorded with --unsafe to do again what it did. progress: called now
// and then with the simulated time. Throws scene::InputError when the recording cannot be run again: touched
// by hand, recorded without its inputs, unsafe and not allowed.
VerificationResult verify(const record::Recording&, int threads, bool unsafe, const std::atomic<bool>& stop,
                          const std::function<void(double)>& progress);

}  // namespace smartsurf::run
