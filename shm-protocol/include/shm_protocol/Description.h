// The description of a surface, as both sides see it: plain values, constant for the session.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace shm_protocol {

enum class Mode : std::uint32_t { kTimeStep = 1, kPassive = 2 };
enum class State : std::uint32_t { kNone, kLoading, kReady, kRunning, kPaused, kClosing, kDead };
enum class Direction : std::uint32_t { kSensor = 1, kActuator = 2 };
enum class DType : std::uint32_t { kF32 = 1, kU32 = 2, kU8 = 3 };

const char* text(Mode) noexcept;
const char* text(State) noexcept;
const char* text(Direction) noexcept;
const char* text(DType) noexcept;

// One array that is exchanged each tick. Shape: components × rows × columns, each component a whole plane;
// planes are row-major, row 0 is north, column 0 is west.
struct ChannelSpec {
  std::string name;  // ≤ 31 of A-Z a-z 0-9 _ . -; unique within its direction
  Direction direction = Direction::kSensor;
  DType dtype = DType::kF32;
  std::uint32_t components = 1;  // per cell, 1 … 64
  std::string unit;              // ≤ 15 characters; "" is dimensionless
  double minimum = 0.0;          // valid range, finite
  double maximum = 1.0;
  double safe = 0.0;  // within the range: stands for NaN, and for every value while there is no controller
};

struct SurfaceConfig {
  std::string
      name;  // ≤ 48 of A-Z a-z 0-9 _ . -, not beginning with a dot; the file is /dev/shm/smartsurf.NAME
  std::uint32_t rows = 0, columns = 0;  // 1 … 65536 each
  double pitch = 1.0;                   // distance of neighbouring cells, > 0, in the surface's length unit
  std::uint64_t period_ns = 0;          // control period, > 0
  Mode mode = Mode::kTimeStep;
  std::vector<ChannelSpec> channels;  // ≤ 32 in the two directions together
  // x, y, z of each cell, rows × columns, row-major; empty for a regular grid of the pitch above.
  std::vector<std::array<float, 3>> positions;
  std::uint32_t slots = 4;  // of each ring: a power of two, 4 … 64
  // What actuator() shows after the controller died or left: its last frame, or every channel's safe value.
  bool hold_last_frame = true;
  // Time-step: actuator() and next_cells() show the answer where the controller wrote it, unchecked, for a surface
  // that copies and checks the values itself and reports them with count_clamped(). Saves a copy. Passive mode
  // copies and checks always, because the controller may overwrite what is being read.
  bool answers_in_place = false;
};

// What a controller finds out about a surface.
struct Description {
  std::string name;
  std::uint16_t version_major = 0, version_minor = 0;
  std::uint64_t session = 0;      // differs between two runs under one name
  std::uint64_t layout_hash = 0;  // equal for equal sizes and channels
  std::uint32_t rows = 0, columns = 0;
  double pitch = 0.0;
  std::uint64_t period_ns = 0;
  Mode mode = Mode::kTimeStep;
  std::vector<ChannelSpec> channels;  // the index here is the channel number of the endpoints
  std::vector<std::array<float, 3>> positions;
  std::uint32_t surface_pid = 0;

  std::size_t cells() const noexcept { return std::size_t{rows} * columns; }
  // The number of the channel of that direction and name, or -1.
  int channel(Direction, const std::string& channel_name) const noexcept;
};

// How one side fares; both sides can read both.
struct Counters {
  std::uint64_t skipped = 0;   // frames of the peer that this side never saw
  std::uint64_t repeated = 0;  // times this side looked and found no newer frame
  std::uint64_t clamped = 0;   // values of the peer that this side replaced: NaN, infinite or out of range
  std::uint64_t deadline_misses = 0;  // periods whose answer came late: counted by a surface of real hardware
};

// Of one frame, as its writer stamped it.
struct FrameInfo {
  std::uint64_t frame = 0;  // 1, 2, 3, … in the order of publication; 0: none yet
  std::uint64_t tick = 0;
  double time_s = 0.0;
  std::uint64_t answers = 0;  // actuator frames: the sensor frame they answer
  std::uint32_t status = 0;   // free for the surface's use; 0 is "all is well"
};

}  // namespace shm_protocol
