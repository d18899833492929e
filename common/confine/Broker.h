// The process that does for a confined one what that may no longer do itself. What it can do is fixed before:
// it is asked by number, and hears no names.
#pragma once

#include <csignal>
#include <cstddef>
#include <functional>
#include <mutex>
#include <vector>

namespace common {

// Defers the signals that end a process while this object lives, on the calling thread.
class SignalsDeferred {
 public:
  SignalsDeferred() noexcept;
  ~SignalsDeferred();
  SignalsDeferred(const SignalsDeferred&) = delete;
  SignalsDeferred& operator=(const SignalsDeferred&) = delete;

 private:
  sigset_t before_{};
};

class Broker {
 public:
  // Runs in the broker's process, and returns a number; an exception is thrown again in the one that asked,
  // as UserError or std::runtime_error with the same text.
  using Service = std::function<int()>;

  // Called in the broker's process when it ends; `ordered`: the other process asked for that, and was not
  // killed.
  using AtEnd = std::function<void(bool ordered)>;

  // Forks the broker. It ends when this process does, however it ends; it does not end by the signals of a
  // terminal or supervisor. Throws std::runtime_error if there is no process. At most one Broker lives at a
  // time.
  Broker(std::vector<Service> services, AtEnd at_end);
  ~Broker();  // asks the broker to end, and waits
  Broker(const Broker&) = delete;
  Broker& operator=(const Broker&) = delete;

  // Waits for the answer; any thread may ask. Throws std::runtime_error if the broker has ended.
  int ask(std::size_t service);
  // Throws as ask() does if the broker has ended.
  void require();

 private:
  std::mutex mutex_;
  int socket_ = -1;
  int process_ = -1;
};

}  // namespace common
