// Makes room at the end of a file that HDF5 writes, before HDF5 writes it. Internal to this module.
//
// HDF5 notes in the file how long the file is, and refuses a shorter one; on its own it may write that note
// before the bytes behind it, so that a process killed in between, or a disk that is full, leaves a file that
// nobody can open. With the room taken beforehand the file is never too short, and a full disk is known
// while the last flush is still whole.
#pragma once

#include <cstdint>
#include <filesystem>

namespace smartsurf::record {

class FilePreallocator {
 public:
  explicit FilePreallocator(const std::filesystem::path& path);  // of an existing file
  ~FilePreallocator();
  FilePreallocator(const FilePreallocator&) = delete;
  FilePreallocator& operator=(const FilePreallocator&) = delete;

  // Makes the file longer by so many bytes that are really there. Throws Hdf5Error when there is no room.
  void preallocate(std::uint64_t bytes);
  // Cuts the file to its length according to HDF5.
  void truncate(std::uint64_t length);

 private:
  int fd_;
};

}  // namespace smartsurf::record
