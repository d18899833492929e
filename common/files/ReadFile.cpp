#include "common/files/ReadFile.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>

#include "common/files/Inputs.h"

namespace common {
namespace {

class FileKinds final : public std::error_category {
 public:
  const char* name() const noexcept override { return "kind of file"; }
  std::string message(int) const override { return "it is not a regular file"; }
};

}  // namespace

std::error_code not_a_regular_file() noexcept {
  static const FileKinds kinds;
  return {1, kinds};
}

std::error_code read_file(const std::filesystem::path& path, std::size_t max_bytes, std::string& bytes) {
  bytes.clear();
  // Without waiting for the writer of a pipe.
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
  if (file < 0) return {errno, std::generic_category()};
  std::error_code error;
  struct stat status {};
  if (::fstat(file, &status) != 0)
    error = {errno, std::generic_category()};
  else if (S_ISDIR(status.st_mode))
    error = std::make_error_code(std::errc::is_a_directory);
  else if (!S_ISREG(status.st_mode))
    error = not_a_regular_file();
  note_input(file);
  char block[1 << 16];
  while (!error) {
    const ssize_t n = ::read(file, block, sizeof block);
    if (n == 0) break;
    if (n < 0 && errno == EINTR) continue;
    if (n < 0)
      error = {errno, std::generic_category()};
    else if (static_cast<std::size_t>(n) > max_bytes - bytes.size())
      error = std::make_error_code(std::errc::file_too_large);
    else
      bytes.append(block, n);
  }
  ::close(file);
  return error;
}

}  // namespace common
