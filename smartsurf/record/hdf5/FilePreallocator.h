// Extends the file before HDF5 writes to its end. Internal to this module.
//
// HDF5 stores the file's length in the file and refuses a shorter one. It may write that length before the
// data, so that a process killed in between, or a full disk, leaves an unreadable file. With the space
// allocated first the file is never too short, and a full disk is detected while the last flush is intact.
#pragma once

#include <cstdint>
#include <filesystem>

namespace smartsurf::record {

class FilePreallocator {
 public:
  // Opens an existing file. Throws Hdf5Error.
  explicit FilePreallocator(const std::filesystem::path& path);
  ~FilePreallocator();
  FilePreallocator(const FilePreallocator&) = delete;
  FilePreallocator& operator=(const FilePreallocator&) = delete;

  // Extends the file by `bytes` allocated bytes. Throws Hdf5Error if the disk is full.
  void preallocate(std::uint64_t bytes);
  // Truncates the file to `length`, its length according to HDF5.
  void truncate(std::uint64_t length);

 private:
  int fd_;
};

}  // namespace smartsurf::record
