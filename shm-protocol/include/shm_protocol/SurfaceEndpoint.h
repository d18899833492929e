// The surface's end of the protocol: owns the segment, publishes sensor frames, receives actuator frames.
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
  // Creates /dev/shm/smartsurf.NAME with mode 0600, in state kReady. Reclaims a segment that a dead surface
  // left under that name. Throws Error: kBadConfig, kSurfaceLives, kForeign, kSystem.
  static SurfaceEndpoint create(const SurfaceConfig&);
  // Closes, unmaps the segment and invalidates all spans.
  ~SurfaceEndpoint();
  SurfaceEndpoint(SurfaceEndpoint&&) noexcept;
  SurfaceEndpoint& operator=(SurfaceEndpoint&&) noexcept;

  // Ends the session: the controller sees kSurfaceClosed, and the segment's file is removed. The mapping, and
  // with it all spans, lasts until destruction. Nothing may be published afterwards.
  void close() noexcept;

  const Description& description() const noexcept;

  // The sensor array that the next publish() sends: components × rows × columns, in place in shared memory.
  // Each publish() moves it to another slot, which holds the values of an old frame: write all of it.
  template <class T = float>
  std::span<T> sensor(int channel) noexcept {
    return as_array<T>(sensor_bytes(channel, dtype_of<T>()));
  }

  // Copies `values` into the sensor array from element `first` on, counted through all components. Faster
  // than writing in place for large arrays: it uses non-temporal stores where they pay off, and the
  // controller can read along with next_cells() if writes ascend; 16 KiB to 64 KiB per call is best. The
  // values are final for this frame.
  template <class T>
  void write(int channel, std::size_t first, std::span<const T> values) noexcept {
    write_bytes(channel, dtype_of<T>(), first * sizeof(T), std::as_bytes(values));
  }

  // Publishes the sensor frame and wakes the controller. Time-step: kOutOfTurn, and nothing is published, if
  // an attached controller has not answered the previous frame.
  [[nodiscard]] Status publish(std::uint64_t tick, double time_s, std::uint32_t status = 0) noexcept;

  // Time-step: waits for the answer to the last published frame, whose tick must be `tick`, and takes it:
  // kOk. Otherwise kTimeout, kInterrupted, kTorn, kOutOfTurn, kNoController (at once), kControllerDead or
  // kControllerClosed, and the previous frame, or the safe values, remain in effect.
  [[nodiscard]] Status await_actuators(std::uint64_t tick, const WaitOptions& = {}) noexcept;

  // Time-step: the next chunk of an actuator channel of the answer being written, checked as by actuator(),
  // as far as the controller has written it. Chunks ascend through all components and hold at most 64 KiB.
  // Blocks until a chunk is available, or only polls if the frame to be answered is not published yet. Empty:
  // the channel is complete, or no more data arrived before the timeout or ever will. Then call
  // await_actuators(): kOk confirms that all chunks belong to the frame taken; after kTorn, next_cells()
  // restarts. Chunks stay valid until then.
  template <class T = float>
  std::span<const T> next_cells(int channel, const WaitOptions& options = {}) noexcept {
    return as_array<const T>(next_bytes(channel, dtype_of<T>(), options));
  }

  // Passive: takes the newest complete actuator frame without waiting: kOk, kRepeated, kTorn, kNoController,
  // kControllerDead, kControllerClosed.
  [[nodiscard]] Status latest_actuators() noexcept;

  // Waits until a controller is attached: kOk, kTimeout, kInterrupted.
  [[nodiscard]] Status await_controller(const WaitOptions& = {}) noexcept;

  // The actuator array in effect: that of the newest frame taken, or the safe values. It is in the endpoint's
  // own memory (answers_in_place: in the answer's slot) and checked: f32 NaN is replaced by the channel's
  // safe value, all other values are clamped to the channel's range. Valid until the next call that takes a
  // frame or reports the loss of the controller.
  template <class T = float>
  std::span<const T> actuator(int channel) const noexcept {
    return as_array<const T>(actuator_bytes(channel, dtype_of<T>()));
  }
  // Metadata of the frame that actuator() returns; frame 0 until the first frame is taken, and after
  // the loss of a controller unless hold_last_frame is set.
  const FrameInfo& actuator_info() const noexcept;

  // kRunning and kPaused are informative only; kClosing ends the controller's waits with kSurfaceClosed.
  void set_state(State) noexcept;

  // Adds to counters().clamped the values that the surface itself replaced (SurfaceConfig::answers_in_place).
  void count_clamped(std::uint64_t values) noexcept;
  // Adds one to counters().deadline_misses: a control period answered late (hardware surfaces).
  void miss_deadline() noexcept;

  // False if another process has removed the segment's file: the session goes on, but no controller can
  // attach.
  bool is_reachable() const noexcept;
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
