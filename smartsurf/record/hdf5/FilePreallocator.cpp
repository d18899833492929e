#include "smartsurf/record/hdf5/FilePreallocator.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "smartsurf/record/hdf5/Hdf5.h"

namespace smartsurf::record {

FilePreallocator::FilePreallocator(const std::filesystem::path& path)
    : fd_(::open(path.c_str(), O_RDWR | O_CLOEXEC)) {
  if (fd_ < 0) throw Hdf5Error(std::strerror(errno));
}

FilePreallocator::~FilePreallocator() { ::close(fd_); }

void FilePreallocator::preallocate(std::uint64_t bytes) {
  struct stat status {};
  if (::fstat(fd_, &status) != 0) throw Hdf5Error(std::strerror(errno));
  const off_t length = static_cast<off_t>(bytes);
  if (::fallocate(fd_, 0, status.st_size, length) == 0) return;
  // A file system without fallocate() can still extend the file.
  if (errno == EOPNOTSUPP && ::ftruncate(fd_, status.st_size + length) == 0) return;
  const std::string reason = std::strerror(errno);
  truncate(static_cast<std::uint64_t>(status.st_size));
  throw Hdf5Error(reason);
}

void FilePreallocator::truncate(std::uint64_t length) {
  // A failure is harmless: HDF5 ignores trailing bytes.
  [[maybe_unused]] const int ignored = ::ftruncate(fd_, static_cast<off_t>(length));
}

}  // namespace smartsurf::record
