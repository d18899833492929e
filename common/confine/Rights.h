// The rights that a confined process still has.
#pragma once

#include <filesystem>
#include <vector>

namespace common {

// Paths that do not exist are ignored.
struct Confinement {
  std::vector<std::filesystem::path> read;           // files, and folders with all that is below
  std::vector<std::filesystem::path> write;          // files that exist, to be read and written
  std::vector<std::filesystem::path> write_folders;  // to create, write and remove files below
  enum class Calls {
    kReader,     // files, memory, time: neither threads nor processes
    kSimulator,  // also threads, and processes of its own program
    kPictures,   // also what OpenGL needs: executable memory, calls to the driver
    kAny,        // Landlock alone
  } calls = Calls::kReader;
};

}  // namespace common
