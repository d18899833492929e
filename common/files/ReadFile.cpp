#include "common/files/ReadFile.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>

namespace common {

std::error_code read_file(const std::filesystem::path& path, std::size_t max_bytes, std::string& bytes) {
  bytes.clear();
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) return {errno, std::generic_category()};
  std::error_code error;
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
      bytes.append(block, static_cast<std::size_t>(n));
  }
  ::close(file);
  return error;
}

}  // namespace common
