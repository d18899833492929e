// Notices that a file was saved.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <string_view>
#include <tuple>

namespace smartsurf::run {

class FileWatch {
 public:
  // text: what was read; a file that has another by now has changed.
  FileWatch(std::filesystem::path file, std::string_view text);
  // True once after each change, when the file has not changed for a fifth of a second: editors write in
  // steps. Looks at the file at most ten times a second.
  bool changed();

 private:
  // Inode, size and time of the last change, ns; zeros without the file.
  using State = std::tuple<std::uint64_t, std::int64_t, std::int64_t>;
  State read() const;

  std::filesystem::path file_;
  State reported_, last_;
  std::chrono::steady_clock::time_point looked_at_, changed_at_;
};

}  // namespace smartsurf::run
