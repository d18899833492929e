// The description of a surface that both sides share: plain values, constant during a session.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
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

// One array exchanged each tick. Shape: components × rows × columns, one plane per component; planes are
// row-major, row 0 is north, column 0 is west.
struct ChannelSpec {
  std::string name;  // ≤ 31 of A-Z a-z 0-9 _ . -; unique within its direction
  Direction direction = Direction::kSensor;
  DType dtype = DType::kF32;
  std::uint32_t components = 1;  // per cell, 1 … 64
  std::string unit;              // ≤ 15 characters; "" is dimensionless
  double minimum = 0.0;          // valid range, finite
  double maximum = 1.0;
  double safe = 0.0;  // within the range; replaces NaN, and applies before there is a controller
};

struct SurfaceConfig {
  // ≤ 48 of A-Z a-z 0-9 _ . -, not beginning with a dot; the file is /dev/shm/smartsurf.NAME.
  std::string name;
  std::uint32_t rows = 0, columns = 0;  // 1 … 65536 each
  double pitch = 1.0;                   // distance between adjacent cells, > 0, in the surface's length unit
  std::uint64_t period_ns = 0;          // control period, > 0
  Mode mode = Mode::kTimeStep;
  std::vector<ChannelSpec> channels;  // ≤ 32 in total
  // x, y, z of each cell, rows × columns, row-major; empty for a regular grid of the pitch above.
  std::vector<std::array<float, 3>> positions;
  std::uint32_t slots = 4;  // per ring: a power of two, 4 … 64
  // After the controller died or left, actuator() returns its last frame (true) or the safe values (false).
  bool hold_last_frame = true;
  // Time-step: actuator() and next_cells() return the answer in place and unchecked. Saves a copy for a
  // surface that copies and checks the values itself and reports replaced ones with count_clamped(). Passive
  // mode always copies and checks, because the controller may overwrite the slot being read.
  bool answers_in_place = false;
  // A reservation of `name` (SurfaceName.h); null: the endpoint creates, names and removes the file itself.
  std::shared_ptr<class SurfaceName> reserved = nullptr;
};

// A surface as read from its segment.
struct Description {
  std::string name;
  std::uint16_t version_major = 0, version_minor = 0;
  std::uint64_t session = 0;      // distinguishes runs under the same name
  std::uint64_t layout_hash = 0;  // equal for equal sizes and channels
  std::uint32_t rows = 0, columns = 0;
  double pitch = 0.0;
  std::uint64_t period_ns = 0;
  Mode mode = Mode::kTimeStep;
  std::vector<ChannelSpec> channels;  // the index here is the channel number of the endpoints
  std::vector<std::array<float, 3>> positions;
  std::uint32_t surface_pid = 0;

  std::size_t cells() const noexcept { return std::size_t{rows} * columns; }
  // The number of the channel with that direction and name, or -1.
  int channel(Direction, std::string_view channel_name) const noexcept;
};

// Counters of one side; both sides can read both.
struct Counters {
  std::uint64_t skipped = 0;          // peer frames that this side never read
  std::uint64_t repeated = 0;         // polls that found no newer frame
  std::uint64_t clamped = 0;          // peer values replaced: NaN, infinite or out of range
  std::uint64_t deadline_misses = 0;  // periods answered late; counted by hardware surfaces
};

// Metadata of one frame, as stamped by its writer.
struct FrameInfo {
  std::uint64_t frame = 0;  // 1, 2, 3, … in the order of publication; 0: none yet
  std::uint64_t tick = 0;
  double time_s = 0.0;
  std::uint64_t answers = 0;  // actuator frames: the sensor frame answered
  std::uint32_t status = 0;   // defined by the surface; 0: no fault
};

}  // namespace shm_protocol
