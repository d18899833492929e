// The observer's end of the protocol: looks at a running pair and touches nothing.
//
// The segment is mapped read-only and nobody waits for an observer, so any number of them may come, stay, be
// stopped or killed. One thread at a time may use an endpoint. Only attach() allocates and throws. A channel
// number is an index into description().channels.
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
  // Maps the segment read-only and checks all of its header. Throws Error: kBadConfig (the name), kNotFound
  // (after the timeout), kWrongVersion, kCorrupt, kForeign, kInterrupted, kSystem.
  static ObserverEndpoint attach(const std::string& name, const AttachOptions& = {});
  ~ObserverEndpoint();
  ObserverEndpoint(ObserverEndpoint&&) noexcept;
  ObserverEndpoint& operator=(ObserverEndpoint&&) noexcept;

  const Description& description() const noexcept;

  // Copies the newest whole frame of that direction: kOk; kRepeated when there is none newer than the one
  // copied last; kTorn when the writer came round the ring during each of several tries (the frame before
  // stands); kSurfaceDead and kSurfaceClosed when there is none newer and none will come.
  [[nodiscard]] Status latest(Direction) noexcept;

  // Looks once a millisecond until there is a newer frame: else as look(), kTimeout or kInterrupted.
  [[nodiscard]] Status await(Direction, const WaitOptions& = {}) noexcept;

  // The array of the frame copied last, in the endpoint's own memory: components × rows × columns. Zeros
  // before the first one. Valid until look() or await() takes the next frame of that direction. The values
  // are as they were written: a controller's may be NaN or out of range.
  template <class T = float>
  std::span<const T> array(int channel) const noexcept {
    return as_array<const T>(bytes(channel, dtype_of<T>()));
  }
  // Of the frame copied last; frame 0: none yet.
  const FrameInfo& info(Direction) const noexcept;
  // Low 32 bits of the newest frame's number, without copying it: what rates are measured from.
  std::uint32_t published(Direction) const noexcept;

  State surface_state() const noexcept;     // kDead after a kill
  State controller_state() const noexcept;  // kNone: nobody is attached; kDead after a kill
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
