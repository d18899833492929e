#include "LivenessLock.h"

#include <fcntl.h>
#include <pthread.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <utility>

#include "FileDescriptor.h"

namespace shm_protocol {
namespace {

// The descriptors of this process's locks, for a forked child to close: −1 a free slot, −2 one that is being
// filled.
constexpr int kFree = -1, kBeingFilled = -2;
constexpr int kSlots = 4096;
struct Slots {
  Slots() noexcept {
    for (std::atomic<int>& slot : descriptors) slot.store(kFree, std::memory_order_relaxed);
    ::pthread_atfork(nullptr, nullptr, close_all);
  }
  static void close_all() noexcept;
  std::array<std::atomic<int>, kSlots> descriptors;
};

Slots& slots() noexcept {
  static Slots all;
  return all;
}

void Slots::close_all() noexcept {
  for (std::atomic<int>& slot : slots().descriptors)
    if (const int descriptor = slot.exchange(kFree); descriptor >= 0) ::close(descriptor);
}

struct flock lock_of(Side side) noexcept {
  struct flock lock {};
  lock.l_type = F_WRLCK;
  lock.l_whence = SEEK_SET;
  lock.l_start = static_cast<off_t>(side);
  lock.l_len = 1;
  return lock;
}

}  // namespace

bool is_locked(int descriptor, Side side) noexcept {
  struct flock lock = lock_of(side);
  return ::fcntl(descriptor, F_OFD_GETLK, &lock) == 0 && lock.l_type != F_UNLCK;
}

LivenessLock::LivenessLock(const std::string& path, int flags, int file) noexcept {
  for (int i = 0; i < kSlots; ++i) {
    int expected = kFree;
    if (!slots().descriptors[i].compare_exchange_strong(expected, kBeingFilled)) continue;
    FileDescriptor opened(open_untrusted(path, flags));
    if (opened.number() >= 0 && is_still(file, path) && is_still(opened.number(), path)) slot_ = i;
    slots().descriptors[i].store(slot_ >= 0 ? opened.detach() : kFree);
    return;
  }
}

LivenessLock::LivenessLock(LivenessLock&& other) noexcept
    : slot_(std::exchange(other.slot_, -1)), holders_(other.holders_) {}

LivenessLock& LivenessLock::operator=(LivenessLock&& other) noexcept {
  std::swap(slot_, other.slot_);
  std::swap(holders_, other.holders_);
  return *this;
}

// In a forked child there is none.
int LivenessLock::descriptor() const noexcept { return slot_ < 0 ? -1 : slots().descriptors[slot_].load(); }

bool LivenessLock::take(Side side) noexcept {
  struct flock lock = lock_of(side);
  return ::fcntl(descriptor(), F_OFD_SETLK, &lock) == 0 || (errno != EAGAIN && errno != EACCES);
}

void LivenessLock::release() noexcept {
  if (const int slot = std::exchange(slot_, -1); slot >= 0)
    if (const int descriptor = slots().descriptors[slot].exchange(kFree); descriptor >= 0)
      ::close(descriptor);
}

bool LivenessLock::is_alive(Side side, ProcessIdentity process) noexcept {
  if (process == 0) return false;
  ProcessIdentity& holder = holders_[static_cast<std::size_t>(side)];
  if (is_locked(descriptor(), side)) {
    holder = process;
    return true;
  }
  return holder != process && shm_protocol::is_alive(process);
}

}  // namespace shm_protocol
