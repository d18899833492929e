// The surface's end of the protocol: owns the segment, publishes sensors, takes in actuators.
//
// One thread at a time may use an endpoint. Only create() allocates and throws; everything on the tick path
// is noexcept. A channel number is an index into description().channels.
//
//   auto surface = SurfaceEndpoint::create(config);
//   for (std::uint64_t tick = 0;; ++tick) {
//     fill(surface.sensor(proximity));
//     if (surface.publish(tick, time_s) != Status::kOk) …
//     if (surface.await_actuators(tick) == Status::kOk) use(surface.actuator(height));
//     …
//   }
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "shm_protocol/Array.h"
#include "shm_protocol/Description.h"
#include "shm_protocol/Error.h"
#include "shm_protocol/Wait.h"

namespace shm_protocol {

class SurfaceEndpoint {
 public:
  // Creates /dev/shm/smartsurf.NAME with mode 0600, in state ready. A segment that a dead surface left under
  // that name is reclaimed. Throws Error: kBadConfig, kSurfaceLives, kForeign, kSystem.
  static SurfaceEndpoint create(const SurfaceConfig&);
  // Marks the surface closing, wakes the controller and removes the segment.
  ~SurfaceEndpoint();
  SurfaceEndpoint(SurfaceEndpoint&&) noexcept;
  SurfaceEndpoint& operator=(SurfaceEndpoint&&) noexcept;

  // What the destructor does, but the mapping and so all spans stay until then. Nothing may be published any
  // more.
  void close() noexcept;

  const Description& description() const noexcept;

  // The sensor array of the frame that publish() will send next: components × rows × columns, in place in
  // shared memory. It moves to another slot at every publish() and then holds an old frame's values: write
  // all of it.
  template <class T = float>
  std::span<T> sensor(int channel) noexcept {
    return as_array<T>(sensor_bytes(channel, dtype_of<T>()));
  }

  // Writes `values` to the cells of the same array from `first` on (counted through all components). For
  // large arrays this is faster than writing in place: it goes past the caches where that is the faster way,
  // and the controller may take the cells with next_cells() while the rest is being written, if it is done in
  // ascending order: pieces of 16 KiB to 64 KiB are best. What was written so is final for this frame.
  template <class T>
  void write(int channel, std::size_t first, std::span<const T> values) noexcept {
    write_bytes(channel, dtype_of<T>(), first * sizeof(T), std::as_bytes(values));
  }

  // Publishes the sensor frame and wakes the controller. In time-step mode an attached controller must have
  // answered the frame before: otherwise kOutOfTurn, and nothing is published.
  [[nodiscard]] Status publish(std::uint64_t tick, double time_s, std::uint32_t status = 0) noexcept;

  // Time-step: waits until the controller has answered the frame published last, whose tick this must be, and
  // takes its frame in: kOk. Else kTimeout, kInterrupted, kTorn, kOutOfTurn, kNoController (at once),
  // kControllerDead, kControllerClosed; the frame before, or the safe one, then stands.
  [[nodiscard]] Status await_actuators(std::uint64_t tick, const WaitOptions& = {}) noexcept;

  // Time-step: the next cells of that actuator channel in the answer to come, checked copies as actuator()
  // shows them, as far as the controller has written them: in ascending order, through all components, at
  // most 64 KiB at a time. Waits until there are some; before the frame to be answered is published it only
  // looks. Empty: that was the last of the channel, or none will come in time or at all. Then call
  // await_actuators(): only its kOk says that all that was handed out is of the frame taken in; after kTorn
  // the next call begins anew. The cells stay valid until then.
  template <class T = float>
  std::span<const T> next_cells(int channel, const WaitOptions& options = {}) noexcept {
    return as_array<const T>(next_bytes(channel, dtype_of<T>(), options));
  }

  // Passive: takes in the newest whole actuator frame without waiting: kOk, kRepeated, kTorn, kNoController,
  // kControllerDead, kControllerClosed.
  [[nodiscard]] Status latest_actuators() noexcept;

  // Waits until a controller is attached: kOk, kTimeout, kInterrupted.
  [[nodiscard]] Status await_controller(const WaitOptions& = {}) noexcept;

  // The actuator array that stands: the newest frame taken in, or the safe one. It lies in the endpoint's own
  // memory (answers_in_place: in the answer's slot), checked: f32 NaN became the channel's safe value,
  // everything else lies within the channel's range. Valid until the next call that takes a frame in, or says
  // that the controller was lost.
  template <class T = float>
  std::span<const T> actuator(int channel) const noexcept {
    return as_array<const T>(actuator_bytes(channel, dtype_of<T>()));
  }
  // Of the frame that actuator() shows; frame 0 while that is the safe one and none was ever taken in.
  const FrameInfo& actuator_info() const noexcept;

  // kRunning and kPaused are for the onlookers; kClosing makes the controller's waits end with
  // kSurfaceClosed.
  void set_state(State) noexcept;

  // Counts actuator values that the surface itself replaced (SurfaceConfig::answers_in_place): readable by all in
  // counters().
  void count_clamped(std::uint64_t values) noexcept;
  // Counts a control period whose answer came late (hardware): readable by everybody in counters().
  void miss_deadline() noexcept;

  bool has_controller() const noexcept;
  std::uint32_t controller_pid() const noexcept;  // 0: none
  State controller_state() const noexcept;
  std::uint32_t controllers_seen() const noexcept;  // attachments in this session
  Counters counters() const noexcept;
  Counters controller_counters() const noexcept;

 private:
  struct Impl;
  explicit SurfaceEndpoint(std::unique_ptr<Impl>);

  std::span<std::byte> sensor_bytes(int channel, DType) noexcept;
  std::span<const std::byte> actuator_bytes(int channel, DType) const noexcept;
  std::span<const std::byte> next_bytes(int channel, DType, const WaitOptions&) noexcept;
  void write_bytes(int channel, DType, std::size_t at, std::span<const std::byte> values) noexcept;

  std::unique_ptr<Impl> impl_;
};

}  // namespace shm_protocol
