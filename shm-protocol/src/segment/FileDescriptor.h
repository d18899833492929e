// An open file, by its descriptor.
#pragma once

#include <string>
#include <utility>

namespace shm_protocol {

// Owns a file descriptor above those of the standard streams; -1: none.
class FileDescriptor {
 public:
  FileDescriptor() noexcept = default;
  // Takes `number`, replacing 0, 1 or 2 by a duplicate. Leaves errno as it is, or says why there is no
  // duplicate.
  explicit FileDescriptor(int number) noexcept;
  ~FileDescriptor();
  FileDescriptor(FileDescriptor&& other) noexcept : number_(std::exchange(other.number_, -1)) {}
  FileDescriptor& operator=(FileDescriptor&& other) noexcept {
    std::swap(number_, other.number_);
    return *this;
  }
  int number() const noexcept { return number_; }
  int detach() noexcept { return std::exchange(number_, -1); }

 private:
  int number_ = -1;
};

// Returns whether the path still names the open file.
bool is_still(int descriptor, const std::string& path) noexcept;

// Opens a file that anyone may have put there: neither a FIFO without a peer, a file lease nor a symbolic
// link delays or redirects the call. Returns the descriptor, or -1 with errno.
int open_untrusted(const std::string& path, int flags) noexcept;

}  // namespace shm_protocol
