// Which files a program may read and write: those in its own folder and in the folders that the user allows.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace apron::run {

class FileAccess {
 public:
  FileAccess() = default;  // every file, for what the user types
  explicit FileAccess(std::vector<std::string> folders) : folders_(std::move(folders)) {}

  // Both throw MediaError (kRefused), and resolve symbolic links first.
  void require_readable(const std::string& file) const;
  // Nor does a program overwrite its own sources, or write to a pipe, a device or a socket.
  void require_writable(const std::string& file) const;

 private:
  std::optional<std::vector<std::string>> folders_;
};

}  // namespace apron::run
