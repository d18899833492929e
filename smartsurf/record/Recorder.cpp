#include "smartsurf/record/Recorder.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "smartsurf/record/CsvRecorder.h"
#include "smartsurf/record/hdf5/Hdf5Recorder.h"

namespace smartsurf::record {
namespace {

namespace fs = std::filesystem;

std::string lowercase_extension(const fs::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension;
}

// Called before the file is truncated: a second run with the same --record must not destroy the file of the
// first.
void require_writable(const fs::path& path) {
  const std::string name = path.string();
  const fs::path directory = path.parent_path().empty() ? fs::path(".") : path.parent_path();
  std::error_code error;
  if (!fs::is_directory(directory, error))
    throw scene::InputError(name + ": cannot be written: there is no directory " + directory.string());
  if (fs::is_directory(path, error))
    throw scene::InputError(name + ": is a directory: give the name of a file in it");
  const int file = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
  if (file < 0) throw scene::InputError(name + ": cannot be written: " + std::strerror(errno));
  // A file system without locks fails with another error than EWOULDBLOCK and is used unlocked.
  const bool locked = ::flock(file, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK;
  ::close(file);
  if (locked) throw scene::InputError(name + ": another process is writing it: give another name");
}

}  // namespace

std::unique_ptr<Recorder> Recorder::open(const fs::path& path, const RunMetadata& meta,
                                         const scene::SceneSpec& spec) {
  const std::string extension = lowercase_extension(path);
  const bool hdf5 = extension == ".h5" || extension == ".hdf5";
  if (!hdf5 && extension != ".csv")
    throw scene::InputError(path.string() + ": unknown kind of recording '" + extension +
                            "': the name must end in .h5 or .hdf5 (everything) or .csv (trajectories)");
  require_writable(path);
  try {
    if (hdf5) return std::make_unique<Hdf5Recorder>(path, meta, spec);
    return std::make_unique<CsvRecorder>(path, spec);
  } catch (...) {
    std::error_code error;
    if (fs::file_size(path, error) == 0) fs::remove(path, error);  // disk full: remove the empty file
    throw;
  }
}

}  // namespace smartsurf::record
