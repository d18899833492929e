// An observer that checks every value it sees.
#pragma once

#include <shm_protocol/ObserverEndpoint.h>

#include "tests/system/shm-protocol/Peer.h"

namespace shm_protocol {

// Looks until the surface ends; every frame whole and right, their numbers ascending. 0: all was well. Calls
// `on_first` after the first frame.
template <class OnFirst = void (*)()>
int check_observed_frames(
    const std::string& name, std::uint64_t& seen, OnFirst on_first = [] {}) {
  auto observer = ObserverEndpoint::attach(name, {.timeout = 20s});
  std::uint64_t last[2] = {};
  for (;;) {
    for (const Direction d : {Direction::kSensor, Direction::kActuator}) {
      const bool sensor = d == Direction::kSensor;
      const Status s = observer.latest(d);
      if (s == Status::kSurfaceClosed || s == Status::kSurfaceDead) return 0;
      if (s != Status::kOk) continue;
      ++seen;
      const FrameInfo& info = observer.info(d);
      if (info.frame <= last[sensor]) return 2;
      last[sensor] = info.frame;
      const bool right = sensor ? matches(observer.array(0), info.tick, sensed)
                                : matches(observer.array(1), info.tick, commanded);
      if (!right) return 3;
      if (seen == 1) on_first();
    }
  }
}

}  // namespace shm_protocol
