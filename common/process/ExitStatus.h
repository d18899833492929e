// Exit statuses shared by all programs, and the line printed for a failure.
#pragma once

#include <exception>
#include <new>

namespace common {

enum ExitStatus {
  kDone = 0,
  kFailed = 1,     // the run failed; what was recorded up to then is kept
  kUserError = 2,  // wrong arguments, script, program or file
  kPeerLost = 3,   // the other process died or hung
};

// what(), except for std::bad_alloc, whose own text names no cause.
inline const char* failure_text(const std::exception& failure) noexcept {
  const bool out_of_memory = dynamic_cast<const std::bad_alloc*>(&failure) != nullptr;
  return out_of_memory ? "there is not enough memory" : failure.what();
}

}  // namespace common
