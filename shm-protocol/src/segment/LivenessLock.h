// Liveness by locks: each side of a session holds a lock on one byte of the segment's file, which the kernel
// releases when its process ends, however it ends. Unlike process words, locks are seen across pid namespaces
// and without /proc.
#pragma once

#include <array>
#include <string>

#include "ProcessIdentity.h"

namespace shm_protocol {

// The byte of the file that the side locks.
enum class Side : int { kSurface = 0, kController = 1 };

// True if another open file description than `descriptor`'s holds the lock of that side.
bool is_locked(int descriptor, Side) noexcept;

// A descriptor for the locks alone: neither mapped nor inherited by a forked child, since either would keep a
// lock beyond the end of its holder.
class LivenessLock {
 public:
  LivenessLock() noexcept = default;
  // Opens the file that `path` names if it is the one that `file` refers to; otherwise no lock is held or
  // seen.
  LivenessLock(const std::string& path, int flags, int file) noexcept;
  ~LivenessLock() { release(); }
  LivenessLock(LivenessLock&&) noexcept;
  LivenessLock& operator=(LivenessLock&&) noexcept;

  // False if another process holds it. True, too, where the system has no such locks.
  bool take(Side) noexcept;
  void release() noexcept;
  // True if the process of that side, not this object's own, is alive: by the lock, if that process was ever
  // seen to hold it, otherwise by the process word.
  bool is_alive(Side, ProcessIdentity) noexcept;

 private:
  int descriptor() const noexcept;

  int slot_ = -1;                                // of the descriptor; -1: none
  std::array<ProcessIdentity, 2> holders_ = {};  // seen to hold the lock of each side
};

}  // namespace shm_protocol
