// The controller's end of the protocol: finds out what a surface has, reads sensors, publishes actuators.
//
// One thread at a time may use an endpoint. Only attach() and reconnect() allocate and throw; everything on
// the tick path is noexcept. A channel number is an index into description().channels. The same loop serves
// both modes:
//
//   auto controller = ControllerEndpoint::attach("table", {.timeout = 10s});
//   while (controller.await_sensors() == Status::kOk) {
//     compute(controller.sensor(proximity), controller.actuator(height));
//     if (controller.publish() != Status::kOk) …
//   }
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "shm_protocol/Array.h"
#include "shm_protocol/Description.h"
#include "shm_protocol/Error.h"
#include "shm_protocol/Wait.h"

namespace shm_protocol {

class ControllerEndpoint {
 public:
  // Maps the segment, checks all of its header and claims the controller's place. Throws Error: kBadConfig
  // (the name), kNotFound (after the timeout), kControllerLives (with its pid), kWrongVersion, kCorrupt,
  // kForeign, kInterrupted, kSystem.
  static ControllerEndpoint attach(const std::string& name, const AttachOptions& = {});
  // Detaches: the surface is told that the controller left in good order.
  ~ControllerEndpoint();
  ControllerEndpoint(ControllerEndpoint&&) noexcept;
  ControllerEndpoint& operator=(ControllerEndpoint&&) noexcept;

  // What the destructor does, but the mapping and so all spans stay until then. Only reconnect() may follow.
  void detach() noexcept;

  const Description& description() const noexcept;

  // Waits for a sensor frame that was not read yet and takes the newest one: kOk, kTimeout, kInterrupted,
  // kTorn, kSurfaceDead, kSurfaceClosed. In time-step mode that is the frame that waits for its answer (a
  // frame that a killed predecessor left unanswered included); after kOk it must be answered with publish()
  // before the next.
  [[nodiscard]] Status await_sensors(const WaitOptions& = {}) noexcept;

  // The same without waiting: kRepeated when there is no new frame.
  [[nodiscard]] Status latest_sensors() noexcept;

  // The sensor array of the frame taken last: components × rows × columns. Time-step: in place in shared
  // memory, where the surface leaves it alone until it is answered. Passive: a private copy, checked to be of
  // one frame.
  template <class T = float>
  std::span<const T> sensor(int channel) const noexcept {
    return as_array<const T>(sensor_bytes(channel, dtype_of<T>()));
  }
  const FrameInfo& sensor_info() const noexcept;

  // Time-step: the next cells of that channel in the frame to come, in place, as far as the surface has
  // written them: in ascending order, through all components, at most 64 KiB at a time. Waits until there are
  // some. Empty: that was the last of the channel, or none will come in time or at all. Then call
  // await_sensors(): only its kOk says that all that was handed out is of one whole frame, and kTorn that it
  // was not. The answer may be written meanwhile, and is published after that. Pays for arrays of 16 KiB and
  // more which the surface write()s.
  template <class T = float>
  std::span<const T> next_cells(int channel, const WaitOptions& options = {}) noexcept {
    return as_array<const T>(next_bytes(channel, dtype_of<T>(), options));
  }

  // The actuator array that publish() will send next, in place in shared memory. It moves to another slot at
  // every publish() and then holds an old frame's values: write all of it.
  template <class T = float>
  std::span<T> actuator(int channel) noexcept {
    return as_array<T>(actuator_bytes(channel, dtype_of<T>()));
  }

  // The actuator array that publish() sent last, in place: for values that continue in the next frame. Before
  // the first publish() its contents are unspecified.
  template <class T = float>
  std::span<const T> published_actuator(int channel) const noexcept {
    return as_array<const T>(published_bytes(channel, dtype_of<T>()));
  }

  // Writes `values` to the cells of the same array from `first` on (counted through all components): the
  // faster way for large arrays, as SurfaceEndpoint::write() is; the surface copies along. Final for this
  // frame, unless await_sensors() or publish() says kTorn.
  template <class T>
  void write(int channel, std::size_t first, std::span<const T> values) noexcept {
    write_bytes(channel, dtype_of<T>(), first * sizeof(T), std::as_bytes(values));
  }

  // Publishes the actuator frame as the answer to the sensor frame taken last. kOutOfTurn: time-step, and no
  // unanswered frame was taken (nothing is published). kTorn: time-step, and the surface has meanwhile given
  // the sensor frame up (nothing is published; await the next one).
  [[nodiscard]] Status publish() noexcept;

  // kRunning and kPaused are for the onlookers.
  void set_state(State) noexcept;
  // kOk, kSurfaceClosed or kSurfaceDead, seen now.
  [[nodiscard]] Status surface_status() noexcept;
  State surface_state() const noexcept;
  Counters counters() const noexcept;
  Counters surface_counters() const noexcept;

  // After kSurfaceDead or kSurfaceClosed: waits for a new surface under the same name and attaches to it. All
  // spans end. Throws as attach() does, and kLayoutChanged when the new one differs in size or channels; the
  // endpoint then stays detached.
  void reconnect(const AttachOptions&);

 private:
  struct Impl;
  explicit ControllerEndpoint(std::unique_ptr<Impl>);

  std::span<const std::byte> sensor_bytes(int channel, DType) const noexcept;
  std::span<const std::byte> next_bytes(int channel, DType, const WaitOptions&) noexcept;
  std::span<std::byte> actuator_bytes(int channel, DType) noexcept;
  std::span<const std::byte> published_bytes(int channel, DType) const noexcept;
  void write_bytes(int channel, DType, std::size_t at, std::span<const std::byte> values) noexcept;

  std::unique_ptr<Impl> impl_;
};

}  // namespace shm_protocol
