// A file under construction, by its descriptor: an output that another program writes.
#pragma once

#include <filesystem>
#include <system_error>

#include "common/files/UnfinishedFile.h"

namespace common {

class NewPart {
 public:
  // Creates the prepared part (PreparedOutputs.h) of the output of that name, or its part_of(); of a link,
  // that of its target. What has the part's name is removed before; nothing is written to it or through it.
  // Throws UserError, which begins with `name`.
  explicit NewPart(const std::filesystem::path& name);
  ~NewPart();  // removes the file, unless commit() has succeeded
  NewPart(const NewPart&) = delete;
  NewPart& operator=(const NewPart&) = delete;

  const std::filesystem::path& path() const { return path_; }
  int descriptor() const { return file_; }  // to read and write, closed by execve
  // Gives the file its name, unless another one has the part's path by now: lost_part().
  std::error_code commit();

 private:
  std::filesystem::path name_, path_;
  UnfinishedFile unfinished_;  // path_
  int file_ = -1;
  bool committed_ = false;
};

}  // namespace common
