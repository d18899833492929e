// A recording under construction: written as NAME.part beside NAME, and renamed once it holds frames, so that
// an older recording of that name survives a run that never begins. Internal to this module.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <optional>

#include "common/files/UnfinishedFile.h"
#include "smartsurf/record/Ownership.h"

namespace smartsurf::record {

class PendingFile {
 public:
  // A pipe or a device is written in place; of a symbolic link, the target is replaced.
  explicit PendingFile(const std::filesystem::path& name);
  ~PendingFile();  // removes an owned file that was never renamed, unless in a child of fork()
  PendingFile(const PendingFile&) = delete;
  PendingFile& operator=(const PendingFile&) = delete;

  // The path to write to. Fixed, so that a file left by a killed run is overwritten by the next.
  const std::filesystem::path& path() const { return path_; }
  const std::filesystem::path& final_path() const { return final_; }
  // Call before writing: removes what a killed run left, so that the file can be created again, never through
  // a link that someone else put there. From here on the file is this object's. Throws std::system_error.
  void own();
  // True if path() must be created (O_EXCL), false if it is opened as it is: a pipe, or prepared before.
  bool must_be_new() const { return must_be_new_; }
  // Call after each write, with the length in bytes that the file must keep until the next.
  void note_length(off_t length);
  // Call before each write and at the end. Throws std::runtime_error if the file was removed, replaced or cut
  // since: what is written to it is lost.
  void require_unchanged() const;
  // Gives the file its final name; only the first call has an effect. Throws std::system_error.
  void commit();
  // Commits, unless that would replace an older file.
  void commit_if_new();

 private:
  Owner owner_;
  std::filesystem::path final_, path_;
  bool owned_ = false, committed_ = false, must_be_new_ = false;
  // The file's. Which file it is, the first note_length() finds out, before others know its name: later, the
  // name may be another file's.
  dev_t device_ = 0;
  ino_t inode_ = 0;
  off_t length_ = 0;
  std::optional<common::UnfinishedFile> unfinished_;  // while owned and not committed
};

}  // namespace smartsurf::record
