// The controller's end of the protocol: discovers a surface, reads sensor frames, publishes actuator frames.
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
  // Maps the segment, validates the whole header and claims the controller role. Throws Error: kBadConfig
  // (invalid name), kNotFound (after the timeout), kControllerLives (with its pid), kWrongVersion, kCorrupt,
  // kForeign, kInterrupted, kSystem.
  static ControllerEndpoint attach(const std::string& name, const AttachOptions& = {});
  // Closes, unmaps the segment and invalidates all spans.
  ~ControllerEndpoint();
  ControllerEndpoint(ControllerEndpoint&&) noexcept;
  ControllerEndpoint& operator=(ControllerEndpoint&&) noexcept;

  // Releases the claim; the surface sees kControllerClosed. The mapping, and with it all spans, lasts until
  // destruction. Only reconnect() may follow.
  void close() noexcept;

  const Description& description() const noexcept;

  // Waits for an unread sensor frame and takes the newest: kOk, kTimeout, kInterrupted, kTorn, kSurfaceDead,
  // kSurfaceClosed. In time-step mode this is the frame that awaits its answer, including one that a killed
  // predecessor left unanswered; after kOk, publish() must answer it before the next call.
  [[nodiscard]] Status await_sensors(const WaitOptions& = {}) noexcept;

  // The same without waiting: kRepeated if there is no new frame.
  [[nodiscard]] Status latest_sensors() noexcept;

  // The channel's array in the last frame taken: components × rows × columns. Time-step: in place in shared
  // memory; the surface does not modify it before the frame is answered. Passive: a private copy, verified
  // to belong to a single frame.
  template <class T = float>
  std::span<const T> sensor(int channel) const noexcept {
    return as_array<const T>(sensor_bytes(channel, dtype_of<T>()));
  }
  const FrameInfo& sensor_info() const noexcept;

  // Time-step: the next chunk of a channel of the frame being written, in place, as far as the surface has
  // written it. Chunks ascend through all components and hold at most 64 KiB. Blocks until a chunk is
  // available. Empty: the channel is complete, or no more data arrived before the timeout or ever will. Then
  // call await_sensors(): kOk confirms that all chunks belong to one complete frame, kTorn that they do not.
  // The actuator arrays may be written in the meantime; publish() follows await_sensors(). Pays off for
  // arrays of 16 KiB and more that the surface writes with write().
  template <class T = float>
  std::span<const T> next_cells(int channel, const WaitOptions& options = {}) noexcept {
    return as_array<const T>(next_bytes(channel, dtype_of<T>(), options));
  }

  // The actuator array that the next publish() sends, in place in shared memory. Each publish() moves it to
  // another slot, which holds the values of an old frame: write all of it.
  template <class T = float>
  std::span<T> actuator(int channel) noexcept {
    return as_array<T>(actuator_bytes(channel, dtype_of<T>()));
  }

  // The actuator array that the last publish() sent, in place: for values that carry over to the next frame.
  // Unspecified before the first publish().
  template <class T = float>
  std::span<const T> published_actuator(int channel) const noexcept {
    return as_array<const T>(published_bytes(channel, dtype_of<T>()));
  }

  // Copies `values` into the actuator array from element `first` on, counted through all components. Faster
  // for large arrays, as SurfaceEndpoint::write(): the surface can read along. The values are final for this
  // frame, unless await_sensors() or publish() returns kTorn.
  template <class T>
  void write(int channel, std::size_t first, std::span<const T> values) noexcept {
    write_bytes(channel, dtype_of<T>(), first * sizeof(T), std::as_bytes(values));
  }

  // Publishes the actuator frame as the answer to the last sensor frame taken. Time-step only: kOutOfTurn if
  // no unanswered frame was taken, kTorn if the surface has abandoned that sensor frame (await the next one);
  // nothing is published in either case.
  [[nodiscard]] Status publish() noexcept;

  // kRunning and kPaused are informative only.
  void set_state(State) noexcept;
  // Checks the surface now: kOk, kSurfaceClosed or kSurfaceDead.
  [[nodiscard]] Status surface_status() noexcept;
  State surface_state() const noexcept;
  Counters counters() const noexcept;
  Counters surface_counters() const noexcept;

  // After kSurfaceDead or kSurfaceClosed: waits for a new surface of the same name and attaches to it.
  // Invalidates all spans. Throws as attach() does, and kLayoutChanged if the new surface differs in size or
  // channels; the endpoint then stays closed.
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
