#include "smartsurf/record/FileReserve.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "smartsurf/record/Hdf5.h"

namespace smartsurf::record {

FileReserve::FileReserve(const std::filesystem::path& path)
    : file_(::open(path.c_str(), O_RDWR | O_CLOEXEC)) {
  if (file_ < 0) throw Hdf5Error(std::strerror(errno));
}

FileReserve::~FileReserve() { ::close(file_); }

void FileReserve::reserve(std::uint64_t bytes) {
  struct stat now {};
  if (::fstat(file_, &now) != 0) throw Hdf5Error(std::strerror(errno));
  const off_t more = static_cast<off_t>(bytes);
  if (::fallocate(file_, 0, now.st_size, more) == 0) return;
  // A file system that cannot promise the bytes can still make the file long enough.
  if (errno == EOPNOTSUPP && ::ftruncate(file_, now.st_size + more) == 0) return;
  const std::string reason = std::strerror(errno);
  give_back(static_cast<std::uint64_t>(now.st_size));
  throw Hdf5Error(reason);
}

void FileReserve::give_back(std::uint64_t length) {
  // A file that stays too long is as readable.
  [[maybe_unused]] const int status = ::ftruncate(file_, static_cast<off_t>(length));
}

}  // namespace smartsurf::record
