// The observer's end of the protocol: reads a running session without affecting it.
//
// The segment is mapped read-only and neither peer waits for an observer, so any number of them may attach,
// stop or be killed at any time. One thread at a time may use an endpoint. Only attach() allocates and
// throws. A channel number is an index into description().channels.
//
//   auto observer = ObserverEndpoint::attach("table");
//   while (observer.await(Direction::kActuator) == Status::kOk)
//     draw(observer.array(height), observer.info(Direction::kActuator).tick);
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

class ObserverEndpoint {
 public:
  // Maps the segment read-only and validates the whole header. Throws Error: kBadConfig (invalid name),
  // kNotFound (after the timeout), kWrongVersion, kCorrupt, kForeign, kInterrupted, kSystem.
  static ObserverEndpoint attach(const std::string& name, const AttachOptions& = {});
  ~ObserverEndpoint();
  ObserverEndpoint(ObserverEndpoint&&) noexcept;
  ObserverEndpoint& operator=(ObserverEndpoint&&) noexcept;

  const Description& description() const noexcept;

  // Copies the newest complete frame of one direction. kOk; kRepeated if no frame is newer than the last
  // copy; kTorn if the writer lapped the reader on every retry (the previous frame is kept); kSurfaceDead or
  // kSurfaceClosed if there is no newer frame and none will follow.
  [[nodiscard]] Status latest(Direction) noexcept;

  // Copies the oldest complete frame that is newer than the last copy and still in the ring, or else as
  // latest(). The first call copies the newest frame. A gap in info().frame counts the frames that were
  // overwritten before.
  [[nodiscard]] Status next(Direction) noexcept;

  // Polls once per millisecond for a newer frame. Returns as latest(), or kTimeout or kInterrupted.
  [[nodiscard]] Status await(Direction, const WaitOptions& = {}) noexcept;

  // The channel's array in the last copied frame, in the endpoint's own memory: components × rows × columns.
  // Zeros before the first frame. Valid until latest(), next() or await() copies another frame of that
  // direction. Values are unchecked: a controller's may be NaN or out of range.
  template <class T = float>
  std::span<const T> array(int channel) const noexcept {
    return as_array<const T>(bytes(channel, dtype_of<T>()));
  }
  // Metadata of the last copied frame; frame 0 before the first.
  const FrameInfo& info(Direction) const noexcept;
  // Low 32 bits of the newest frame number, without copying the frame. For measuring rates.
  std::uint32_t published(Direction) const noexcept;

  State surface_state() const noexcept;     // kDead if the process is gone
  State controller_state() const noexcept;  // kNone: not attached; kDead if the process is gone
  std::uint32_t controller_pid() const noexcept;
  std::uint32_t controllers_seen() const noexcept;
  Counters surface_counters() const noexcept;
  Counters controller_counters() const noexcept;

 private:
  struct Impl;
  explicit ObserverEndpoint(std::unique_ptr<Impl>);

  std::span<const std::byte> bytes(int channel, DType) const noexcept;

  std::unique_ptr<Impl> impl_;
};

}  // namespace shm_protocol
