#include "smartsurf/record/OpenRecorder.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <memory>
#include <system_error>
#include <utility>

#include "common/files/PreparedOutputs.h"
#include "common/text/Words.h"
#include "smartsurf/record/CsvRecorder.h"
#include "smartsurf/record/PendingFile.h"
#include "smartsurf/record/hdf5/Hdf5Recorder.h"

namespace smartsurf::record {
namespace {

namespace fs = std::filesystem;

// Throws if someone has the file open, on whom HDF5's locks tell: a writer's is exclusive, those of readers
// are shared. A file system without locks fails with another error than EWOULDBLOCK.
void require_unlocked(const fs::path& path, const fs::path& file_name) {
  const int file = ::open(file_name.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (file < 0) return;
  const bool is_open = ::flock(file, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK;
  const bool is_read = is_open && ::flock(file, LOCK_SH | LOCK_NB) == 0;
  ::close(file);
  if (is_open)
    throw scene::InputError(path.string() + (is_read ? ": is open for reading: close it or give another name"
                                                     : ": another process is writing it: give another name"));
}

// A second run with the same --record must not destroy the file of the first.
void require_writable(const fs::path& path, const fs::path& pending) {
  const std::string name = path.string();
  const fs::path directory = path.parent_path().empty() ? fs::path(".") : path.parent_path();
  std::error_code error;
  if (!fs::is_directory(directory, error))
    throw scene::InputError(name + ": cannot be written: there is no directory " + directory.string());
  if (fs::is_directory(path, error))
    throw scene::InputError(name + ": is a directory: give the name of a file in it");
  if (const std::string reason = common::too_long_for_part(fs::path(pending).replace_extension(), pending);
      !reason.empty() && pending != path)
    throw scene::InputError(name + ": cannot be written: " + reason);
  require_unlocked(path, path);
  require_unlocked(path, pending);
  const bool exists = ::access(path.c_str(), F_OK) == 0;
  for (const fs::path& target : {pending != path ? directory : path, exists ? path : directory})
    if (::access(target.c_str(), W_OK) != 0)
      throw scene::InputError(name + ": cannot be written: " + std::strerror(errno));
}

bool is_hdf5(const fs::path& path) {
  const std::string extension = common::lower_case(path.extension().string());
  const bool hdf5 = extension == ".h5" || extension == ".hdf5";
  if (!hdf5 && extension != ".csv")
    throw scene::InputError(path.string() + ": unknown kind of recording '" + extension +
                            "': the name must end in .h5 or .hdf5 (everything) or .csv (trajectories)");
  return hdf5;
}

// HDF5 writes at many places of its file.
void require_regular(const fs::path& path) {
  std::error_code error;
  if (const fs::file_status status = fs::status(path, error);
      fs::exists(status) && !fs::is_regular_file(status))
    throw scene::InputError(path.string() + ": is not a regular file, which a recording in HDF5 must be");
}

}  // namespace

common::PreparedOutput prepare_recording(const fs::path& path) {
  const bool hdf5 = is_hdf5(path);
  const PendingFile pending(path);
  require_writable(path, pending.path());
  if (hdf5) require_regular(path);
  return common::prepare_output(path.string(), pending.final_path(), pending.path());
}

std::unique_ptr<Recorder> open_recorder(const fs::path& path, const RunMetadata& meta,
                                        const scene::SceneSpec& spec) {
  const bool hdf5 = is_hdf5(path);
  auto pending = std::make_unique<PendingFile>(path);
  if (!common::is_prepared(pending->path()))
    require_writable(path, pending->path());
  else
    require_unlocked(path, pending->path());
  if (hdf5) require_regular(path);
  try {
    pending->own();
  } catch (const std::system_error& error) {
    throw scene::InputError(path.string() + ": cannot be written: " + error.code().message());
  }
  if (hdf5) return std::make_unique<Hdf5Recorder>(path, std::move(pending), meta, spec);
  return std::make_unique<CsvRecorder>(path, std::move(pending), spec);
}

}  // namespace smartsurf::record
