// Options of waits on the tick path, and the status that tick-path calls return.
#pragma once

#include <atomic>
#include <chrono>

namespace shm_protocol {

enum class Status {
  kOk,
  kRepeated,          // passive: no newer frame; the one before still stands
  kTorn,              // the frame changed while it was read, or is malformed; the one before still stands
  kTimeout,           // the deadline passed; nothing else happened
  kInterrupted,       // the stop flag was raised
  kOutOfTurn,         // time-step: this call would run ahead of the peer, or nothing was published yet
  kNoController,      // nobody is attached
  kControllerDead,    // the controller was killed or ended without detaching (told once)
  kControllerClosed,  // the controller detached (told once)
  kSurfaceDead,       // the surface was killed or ended without closing
  kSurfaceClosed      // the surface is closing
};

const char* text(Status) noexcept;

struct WaitOptions {
  static constexpr std::chrono::nanoseconds kForever = std::chrono::nanoseconds::max();

  // How long to wait for the peer; a dead peer ends any wait within 1 s, a paused one never does.
  std::chrono::nanoseconds timeout = kForever;
  // Looked at about 20 times a second while waiting; may be raised by a signal handler or another thread.
  const std::atomic<bool>* stop = nullptr;
};

struct AttachOptions {
  // How long to wait for a surface of that name to appear; 0: it must be there.
  std::chrono::nanoseconds timeout{0};
  const std::atomic<bool>* stop = nullptr;
};

}  // namespace shm_protocol
