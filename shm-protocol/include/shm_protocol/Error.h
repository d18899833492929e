// The exception thrown when a segment cannot be created or attached: a code and a one-line message.
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>

namespace shm_protocol {

enum class ErrorCode {
  kBadConfig,        // the caller's description or name is invalid
  kSurfaceLives,     // create: a living surface owns the name; see pid()
  kNotFound,         // attach: no such segment, or only one whose surface is dead or closing
  kControllerLives,  // attach: another controller is attached; see pid()
  kWrongVersion,     // another major version; what() names both
  kCorrupt,          // the header is inconsistent, or does not match the file size; what() names the field
  kForeign,          // the file of this name is another user's or no segment of this protocol
  kLayoutChanged,    // reconnect: the new surface has different channels or a different size
  kInterrupted,      // the stop flag was raised
  kSystem            // a system call failed: no space in /dev/shm, no permission, …
};

class Error : public std::runtime_error {
 public:
  Error(ErrorCode code, const std::string& what, std::uint32_t pid = 0)
      : std::runtime_error(what), code_(code), pid_(pid) {}

  ErrorCode code() const noexcept { return code_; }
  // The process that holds the resource, or 0.
  std::uint32_t pid() const noexcept { return pid_; }

 private:
  ErrorCode code_;
  std::uint32_t pid_;
};

}  // namespace shm_protocol
