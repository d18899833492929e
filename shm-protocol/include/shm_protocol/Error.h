// Errors of creating and attaching a segment: a code and one line of text.
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>

namespace shm_protocol {

enum class ErrorCode {
  kBadConfig,        // the caller's own description or name is impossible
  kSurfaceLives,     // create: a living surface owns the name; pid() names it
  kNotFound,         // attach: no such segment, or only one whose surface is dead or closing
  kControllerLives,  // attach: another controller is attached; pid() names it
  kWrongVersion,     // another major version; what() names both
  kCorrupt,          // the header contradicts itself or the segment's real size; what() names the field
  kForeign,          // the file under this name is not a segment of this protocol
  kLayoutChanged,    // reconnect: the new surface has other channels or another size
  kInterrupted,      // the stop flag was raised
  kSystem            // the operating system refused: no space in /dev/shm, no permission, …
};

class Error : public std::runtime_error {
 public:
  Error(ErrorCode code, const std::string& what, std::uint32_t pid = 0)
      : std::runtime_error(what), code_(code), pid_(pid) {}

  ErrorCode code() const noexcept { return code_; }
  // The process in the way, or 0.
  std::uint32_t pid() const noexcept { return pid_; }

 private:
  ErrorCode code_;
  std::uint32_t pid_;
};

}  // namespace shm_protocol
