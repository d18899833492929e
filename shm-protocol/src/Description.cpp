#include "shm_protocol/Description.h"

#include <iterator>

namespace shm_protocol {

const char* text(Mode mode) noexcept { return mode == Mode::kTimeStep ? "time-step" : "passive"; }

const char* text(State state) noexcept {
  constexpr const char* kNames[] = {"none", "loading", "ready", "running", "paused", "closing", "dead"};
  const auto i = static_cast<std::size_t>(state);
  return i < std::size(kNames) ? kNames[i] : "unknown";
}

const char* text(Direction direction) noexcept {
  return direction == Direction::kSensor ? "sensor" : "actuator";
}

const char* text(DType dtype) noexcept {
  return dtype == DType::kF32 ? "f32" : dtype == DType::kU32 ? "u32" : "u8";
}

int Description::channel(Direction direction, std::string_view channel_name) const noexcept {
  for (int i = 0; i < std::ssize(channels); ++i)
    if (channels[i].direction == direction && channels[i].name == channel_name) return i;
  return -1;
}

}  // namespace shm_protocol
