#include "Ownership.h"

#include <dirent.h>
#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <string_view>
#include <thread>

#include "LivenessLock.h"
#include "SegmentNames.h"
#include "shm_protocol/layout.h"

namespace shm_protocol {
namespace {

SegmentInfo inspect_descriptor(int descriptor, const std::string& file) {
  SegmentInfo info;
  info.name = file.substr(std::strlen(kFilePrefix));
  struct stat status {};
  if (::fstat(descriptor, &status) != 0) return info;
  info.user = status.st_uid;
  if (!S_ISREG(status.st_mode)) return info;
  // Root cleans for all.
  if (const uid_t self = ::geteuid(); self != 0 && status.st_uid != self) return info;
  info.bytes = static_cast<std::uint64_t>(status.st_size);

  if (const auto mark = info.name.find(kBuildMarker); mark != std::string::npos) {
    const ProcessIdentity builder = std::strtoull(info.name.c_str() + mark + 1, nullptr, 10);
    info.surface_pid = pid_of(builder);
    info.ownership =
        is_locked(descriptor, Side::kSurface) || is_alive(builder) ? Ownership::kLiving : Ownership::kOrphan;
    return info;
  }
  // Read, not mapped: a truncated file yields fewer bytes instead of a SIGBUS.
  ssp_header header{};
  const ssize_t got = ::pread(descriptor, &header, sizeof header, 0);
  const ssp_identity& id = header.identity;
  if (got < static_cast<ssize_t>(sizeof id) || id.magic != SSP_MAGIC || id.surface_process == 0) return info;
  info.version_major = static_cast<std::uint16_t>(id.version >> 16);
  info.version_minor = static_cast<std::uint16_t>(id.version & 0xFFFF);
  info.surface_pid = pid_of(id.surface_process);
  info.ownership = is_locked(descriptor, Side::kSurface) || is_alive(id.surface_process) ? Ownership::kLiving
                                                                                         : Ownership::kOrphan;
  if (info.version_major == SSP_VERSION_MAJOR && header.claim.controller_process != 0 &&
      (is_locked(descriptor, Side::kController) || is_alive(header.claim.controller_process)))
    info.controller_pid = pid_of(header.claim.controller_process);
  return info;
}

}  // namespace

// A program without standard streams would print into a file that is opened as one of them.
bool lock_within_bound(int descriptor) noexcept {
  struct stat status {};
  // Another user's lock is not worth a wait: that user may hold locks on any number of files.
  const bool own = ::fstat(descriptor, &status) == 0 && status.st_uid == ::geteuid();
  const auto timeout = std::chrono::milliseconds(own ? 300 : 0);
  const auto start = std::chrono::steady_clock::now();
  while (::flock(descriptor, LOCK_EX | LOCK_NB) != 0) {
    if (errno != EWOULDBLOCK && errno != EINTR) return false;
    if (std::chrono::steady_clock::now() - start >= timeout) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return true;
}

SegmentInfo inspect_segment(const std::string& file) {
  const FileDescriptor opened(open_untrusted(std::string(kShmDirectory) + "/" + file, O_RDONLY));
  if (opened.number() >= 0) return inspect_descriptor(opened.number(), file);
  SegmentInfo unknown;
  unknown.name = file.substr(std::strlen(kFilePrefix));
  return unknown;
}

bool remove_if_orphan(const std::string& file) {
  const std::string path = std::string(kShmDirectory) + "/" + file;
  const FileDescriptor opened(open_untrusted(path, O_RDONLY));
  if (opened.number() < 0) return false;
  // Every remover holds this lock and has verified that the name still refers to this file. So nobody can
  // replace the file by a living surface's segment between the check and the unlink.
  if (inspect_descriptor(opened.number(), file).ownership != Ownership::kOrphan) return false;
  if (!lock_within_bound(opened.number())) return false;
  if (!is_still(opened.number(), path)) return false;
  if (inspect_descriptor(opened.number(), file).ownership != Ownership::kOrphan) return false;
  return ::unlink(path.c_str()) == 0;
}

// Not a std::filesystem::directory_iterator, which ends the process if it gets no memory.
std::vector<std::string> files_in_shm(const std::string& prefix) {
  const std::unique_ptr<DIR, int (*)(DIR*)> folder(::opendir(kShmDirectory), ::closedir);
  std::vector<std::string> files;
  while (const dirent* entry = folder ? ::readdir(folder.get()) : nullptr)
    if (std::string_view(entry->d_name).starts_with(prefix)) files.emplace_back(entry->d_name);
  return files;
}

std::vector<SegmentInfo> list_segments() {
  std::vector<SegmentInfo> found;
  for (const std::string& file : files_in_shm(kFilePrefix)) found.push_back(inspect_segment(file));
  std::sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.name < b.name; });
  return found;
}

std::vector<SegmentInfo> remove_orphans(const std::string& prefix) {
  std::vector<SegmentInfo> removed;
  for (const auto& segment : list_segments())
    if (segment.ownership == Ownership::kOrphan && segment.name.starts_with(prefix) &&
        remove_if_orphan(kFilePrefix + segment.name))
      removed.push_back(segment);
  return removed;
}

bool remove_orphans_of(const std::string& name) {
  const std::string file = file_name(name);
  remove_if_orphan(file);
  for (const std::string& built : files_in_shm(file + kBuildMarker)) remove_if_orphan(built);
  return ::access((std::string(kShmDirectory) + "/" + file).c_str(), F_OK) != 0 &&
         files_in_shm(file + kBuildMarker).empty();
}

}  // namespace shm_protocol
