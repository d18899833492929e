// How the program ends: its exit status, and what it says of a failure.
#pragma once

#include <exception>
#include <new>

namespace smartsurf::run {

// Exit statuses of the program.
enum ExitStatus { kDone = 0, kFailed = 1, kUserError = 2, kPeerLost = 3 };

// What a person is told of a failure: a library's own word for a full memory says nothing.
inline const char* failure_text(const std::exception& error) noexcept {
  const bool out_of_memory = dynamic_cast<const std::bad_alloc*>(&error) != nullptr;
  return out_of_memory ? "there is not enough memory for this run: take fewer cells or objects"
                       : error.what();
}

}  // namespace smartsurf::run
