#pragma once

#include <atomic>
#include <stdexcept>

namespace smartsurf::python {

// Held during a call: other Python threads run while worlds compute, and may not use the same worlds
// meanwhile.
class Exclusive {
 public:
  explicit Exclusive(std::atomic_flag& in_use) : in_use_(in_use) {
    if (in_use_.test_and_set())
      throw std::runtime_error("another thread is using this environment: call it from one thread at a time");
  }
  ~Exclusive() { in_use_.clear(); }
  Exclusive(const Exclusive&) = delete;
  Exclusive& operator=(const Exclusive&) = delete;

 private:
  std::atomic_flag& in_use_;
};

}  // namespace smartsurf::python
