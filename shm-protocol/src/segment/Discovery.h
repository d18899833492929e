// Finds a living surface's segment and retries until a deadline; shared by controllers and observers.
#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <thread>

#include "ProcessIdentity.h"
#include "Segment.h"
#include "SegmentLayout.h"
#include "shm-protocol/src/wait/FutexWait.h"
#include "shm_protocol/Error.h"
#include "shm_protocol/Wait.h"

namespace shm_protocol {

struct FoundSurface {
  Segment segment;
  SegmentLayout layout;
};

// Returns the validated segment of a living surface that is not closing, or nothing and the reason in `why`.
// Throws Error: kWrongVersion, kCorrupt, kForeign, kSystem.
std::optional<FoundSurface> find_surface(const std::string& name, Access, std::string& why);

// Calls attempt(why) until it returns a value. Throws Error: kNotFound with the last `why` after the timeout,
// or kInterrupted.
template <class Attempt>
auto attach_with_retry(const std::string& name, const AttachOptions& options, Attempt&& attempt) {
  constexpr std::chrono::milliseconds kRetryInterval{10};
  check_name(name);
  const auto start = Clock::now();
  for (std::string why;;) {
    if (auto result = attempt(why)) return result;
    if (options.stop && options.stop->load(std::memory_order_relaxed))
      throw Error(ErrorCode::kInterrupted, "interrupted while waiting: " + why);
    if (Clock::now() - start >= options.timeout) throw Error(ErrorCode::kNotFound, why);
    std::this_thread::sleep_for(kRetryInterval);
  }
}

}  // namespace shm_protocol
