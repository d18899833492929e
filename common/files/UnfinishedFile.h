// Files that a process must not leave behind, even if it ends without running destructors.
#pragma once

#include <filesystem>

namespace common {

// Notes a file, or an empty folder, while it lives; to remove it otherwise is the owner's business. At most 16 are noted at
// once, with paths of at most 1023 bytes; others are not. Any thread.
class UnfinishedFile {
 public:
  explicit UnfinishedFile(const std::filesystem::path&) noexcept;
  ~UnfinishedFile();
  UnfinishedFile(const UnfinishedFile&) = delete;
  UnfinishedFile& operator=(const UnfinishedFile&) = delete;

 private:
  int slot_ = -1;
};

// Removes the files that this process has noted; those of its parent stay. Async-signal-safe.
void remove_unfinished_files() noexcept;

}  // namespace common
