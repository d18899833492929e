// Options of waits on the tick path, and the status that tick-path calls return.
#pragma once

#include <atomic>
#include <chrono>

namespace shm_protocol {

enum class Status {
  kOk,
  kRepeated,          // passive: no newer frame; the previous one is kept
  kTorn,              // the frame changed while it was read, or is malformed; the previous one is kept
  kTimeout,           // the deadline passed; nothing else happened
  kInterrupted,       // the stop flag was raised
  kOutOfTurn,         // time-step: this call would run ahead of the peer, or nothing was published yet
  kNoController,      // no controller is attached
  kControllerDead,    // the controller exited without close() (reported once)
  kControllerClosed,  // the controller closed (reported once)
  kSurfaceDead,       // the surface exited without close()
  kSurfaceClosed      // the surface is closing
};

const char* text(Status) noexcept;

struct WaitOptions {
  static constexpr std::chrono::nanoseconds kForever = std::chrono::nanoseconds::max();

  // Maximum wait for the peer. The death of the peer ends any wait within 1 s; a pause never does.
  std::chrono::nanoseconds timeout = kForever;
  // Polled about 20 times a second while waiting; a signal handler or another thread may raise it.
  const std::atomic<bool>* stop = nullptr;
};

struct AttachOptions {
  // Maximum wait for a surface of that name to appear; 0: it must already exist.
  std::chrono::nanoseconds timeout{0};
  const std::atomic<bool>* stop = nullptr;
};

}  // namespace shm_protocol
