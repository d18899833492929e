// The state of a surface that shm_dump shows, read through an observer.
#pragma once

#include <shm_protocol/ObserverEndpoint.h>

#include <optional>
#include <string>
#include <vector>

namespace shm_protocol::dump {

struct Rates {
  double sensors_hz = 0, actuators_hz = 0;
};

struct SurfaceStatus {
  const Description* description = nullptr;  // lives as long as the observer
  State surface = State::kNone, controller = State::kNone;
  std::uint32_t controller_pid = 0, controllers_seen = 0;
  Counters surface_counters, controller_counters;
  FrameInfo sensors, actuators;
  bool sensors_torn = false, actuators_torn = false;
  std::optional<Rates> rates;

  const FrameInfo& frame(Direction d) const { return d == Direction::kSensor ? sensors : actuators; }
};

// The array of a channel, converted to double, in array order.
std::vector<double> values(const ObserverEndpoint&, int channel);

// Minimum, mean and maximum of the finite values; `non_finite` counts NaN and infinities.
struct ValueStatistics {
  double minimum = 0, mean = 0, maximum = 0;
  std::size_t non_finite = 0;
};
ValueStatistics value_statistics(const std::vector<double>&);

}  // namespace shm_protocol::dump
