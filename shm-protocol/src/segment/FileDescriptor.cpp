#include "FileDescriptor.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>

namespace shm_protocol {

FileDescriptor::FileDescriptor(int number) noexcept : number_(number) {
  if (number < 0 || number > 2) return;
  number_ = ::fcntl(number, F_DUPFD_CLOEXEC, 3);
  const int failure = errno;
  ::close(number);
  errno = failure;
}

FileDescriptor::~FileDescriptor() {
  if (number_ >= 0) ::close(number_);
}

bool is_still(int descriptor, const std::string& path) noexcept {
  struct stat mine {
  }, there{};
  return ::fstat(descriptor, &mine) == 0 && ::lstat(path.c_str(), &there) == 0 &&
         mine.st_dev == there.st_dev && mine.st_ino == there.st_ino;
}

int open_untrusted(const std::string& path, int flags) noexcept {
  return ::open(path.c_str(), flags | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK | O_NOCTTY);
}

}  // namespace shm_protocol
