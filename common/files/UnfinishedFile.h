// Files that a process must not leave behind, even if it ends without running destructors.
#pragma once

#include <filesystem>

namespace common {

// Registers a file, or an empty folder, for removal while this object lives. In the ordinary case the owner
// removes it. At most 16 paths of at most 1023 bytes are registered at once; further ones are ignored. May be
// used on any thread.
class UnfinishedFile {
 public:
  explicit UnfinishedFile(const std::filesystem::path&) noexcept;
  ~UnfinishedFile();
  UnfinishedFile(const UnfinishedFile&) = delete;
  UnfinishedFile& operator=(const UnfinishedFile&) = delete;

 private:
  int slot_ = -1;
};

// Removes the files that this process has registered, but not those of its parent. Async-signal-safe.
void remove_unfinished_files() noexcept;
// Sets the function that remove_unfinished_files() calls at the end: also async-signal-safe.
void at_removal_of_unfinished_files(void (*)()) noexcept;

}  // namespace common
