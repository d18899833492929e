// A process that cleans up after this one, however this one ends.
#pragma once

#include <sys/types.h>

#include <functional>

namespace common {

class Guardian {
 public:
  // Forks a process that waits for the end of this one and then calls `clean`; not if this object is
  // destroyed before. It has no open files, and is in a session of its own: what ends this process's group
  // leaves it alone. Without pidfd_open (Linux 5.3) or a free process there is none.
  explicit Guardian(const std::function<void()>& clean) noexcept;
  ~Guardian();
  // The process stays until the end of this one, although this object is destroyed.
  void stay() noexcept { process_ = -1; }
  Guardian(const Guardian&) = delete;
  Guardian& operator=(const Guardian&) = delete;

 private:
  int dismissal_ = -1;  // a socket
  pid_t process_ = -1;
};

}  // namespace common
