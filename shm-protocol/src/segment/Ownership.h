// Determines the owner of a file in /dev/shm from its header without mapping it, and removes orphans safely.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "ProcessIdentity.h"
#include "shm_protocol/Segments.h"

namespace shm_protocol {

// Owns a file descriptor above those of the standard streams; -1: none.
class FileDescriptor {
 public:
  FileDescriptor() noexcept = default;
  // Takes `number`, replacing 0, 1 or 2 by a duplicate. Leaves errno as it is, or says why there is no duplicate.
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

// `file` is a name within /dev/shm that begins with "smartsurf.". Missing or unreadable: kForeign.
SegmentInfo inspect_segment(const std::string& file);

// The names of the files in /dev/shm that begin with `prefix`.
std::vector<std::string> files_in_shm(const std::string& prefix);

// Opens a file that anyone may have put there: neither a FIFO without a peer, a file lease nor a symbolic link
// delays or redirects the call. Returns the descriptor, or -1 with errno.
int open_untrusted(const std::string& path, int flags) noexcept;

// Takes the exclusive lock that serialises the removers of a file. False if another process holds it for
// longer than a remover needs.
bool lock_within_bound(int descriptor) noexcept;

// Removes the file if it is an orphan, checked under a lock on the file. False if it is no orphan, is gone or
// stays locked.
bool remove_if_orphan(const std::string& file);

}  // namespace shm_protocol
