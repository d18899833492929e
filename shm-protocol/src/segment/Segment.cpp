#include "Segment.h"

#include <fcntl.h>
#include <stdio.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <boost/interprocess/mapped_region.hpp>
#include <cerrno>
#include <cstring>
#include <utility>

#include "Ownership.h"
#include "shm_protocol/Error.h"

namespace shm_protocol {
namespace {

namespace bip = boost::interprocess;

[[noreturn]] void system_error(const std::string& what, int number) {
  throw Error(ErrorCode::kSystem, what + ": " + std::strerror(number));
}

[[noreturn]] void throw_foreign(const std::string& path) {
  throw Error(ErrorCode::kForeign,
              path +
                  " is not a segment of this protocol, or belongs to another user; remove "
                  "it by hand or choose another name");
}

std::string file_name(const std::string& name) { return kFilePrefix + name; }

// Removes segments left by killed builders of this name; the file name identifies the builder's process.
void remove_stale_builds(const std::string& name) {
  for (const std::string& file : files_in_shm(file_name(name) + kBuildMarker)) remove_if_orphan(file);
}

// An open file, in the form that bip::mapped_region takes.
struct MappableFile {
  int descriptor;
  bip::mode_t mode;
  bip::mapping_handle_t get_mapping_handle() const { return {descriptor, false}; }
  bip::mode_t get_mode() const { return mode; }
};

bip::mapped_region map(const FileDescriptor& file, bip::mode_t mode, const std::string& path) {
  try {
    return bip::mapped_region(MappableFile{file.number(), mode}, mode);
  } catch (const bip::interprocess_exception& e) {
    throw Error(ErrorCode::kSystem, "cannot map " + path + ": " + e.what());
  }
}

}  // namespace

struct Segment::Impl {
  std::string name;            // final name
  std::string path;            // of the final name
  std::string temporary_path;  // of the private name, until renamed into place
  FileDescriptor file;
  LivenessLock liveness;
  bip::mapped_region region;
  pid_t builder = 0;
};

std::string path_of(const std::string& name) { return std::string(kShmDirectory) + "/" + file_name(name); }

Segment::Segment(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Segment::Segment(Segment&&) noexcept = default;
Segment& Segment::operator=(Segment&&) noexcept = default;

Segment::~Segment() {
  if (impl_ && !impl_->temporary_path.empty() && impl_->builder == ::getpid())
    ::unlink(impl_->temporary_path.c_str());
}

Segment Segment::create(const std::string& name, std::size_t bytes, ProcessIdentity owner) {
  remove_stale_builds(name);
  auto impl = std::make_unique<Impl>();
  impl->name = name;
  impl->path = path_of(name);
  impl->builder = ::getpid();
  static std::atomic<unsigned> build_count{0};  // two threads may build under one name; one will be refused
  const std::string file =
      file_name(name) + kBuildMarker + std::to_string(owner) + "." + std::to_string(build_count++);
  const std::string path = std::string(kShmDirectory) + "/" + file;
  impl->temporary_path.reserve(path.size());
  impl->file = FileDescriptor(::open(path.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0600));
  if (impl->file.number() < 0) system_error("cannot create " + impl->path, errno);
  impl->temporary_path = path;
  impl->liveness = LivenessLock(path, O_RDWR, impl->file.number());
  impl->liveness.take(Side::kSurface);
  Segment segment(std::move(impl));
  // Reserve the memory now, so that a full /dev/shm is an error here and not a SIGBUS during a run.
  const FileDescriptor& opened = segment.impl_->file;
  if (const int failure = ::posix_fallocate(opened.number(), 0, static_cast<off_t>(bytes)))
    system_error("cannot reserve " + std::to_string(bytes) + " bytes in /dev/shm for " + path_of(name),
                 failure);
  segment.impl_->region = map(opened, bip::read_write, path_of(name));
  return segment;
}

void Segment::rename_into_place() {
  const std::string& from = impl_->temporary_path;
  const std::string& to = impl_->path;
  for (int attempt = 0; attempt < 100; ++attempt) {
    reclaim_or_throw(impl_->name);
    if (::renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), RENAME_NOREPLACE) == 0) {
      impl_->temporary_path.clear();
      return;
    }
    if (errno != EEXIST) break;
  }
  system_error("cannot put " + to + " in place", errno);
}

void Segment::remove() noexcept {
  const int descriptor = impl_->file.number();
  // The lock serialises this with a cleaner that has just found the same file (see remove_if_orphan). A
  // cleaner holds it for microseconds, and removes nothing while this process lives.
  lock_within_bound(descriptor);
  if (is_still(descriptor, impl_->path)) ::unlink(impl_->path.c_str());
  ::flock(descriptor, LOCK_UN);
}

std::optional<Segment> Segment::open(const std::string& name, Access access) {
  const bip::mode_t mode = access == Access::kReadOnly ? bip::read_only : bip::read_write;
  const std::string path = path_of(name);
  auto impl = std::make_unique<Impl>();
  impl->name = name;
  impl->path = path;
  impl->file = FileDescriptor(open_untrusted(path, access == Access::kReadOnly ? O_RDONLY : O_RDWR));
  const int descriptor = impl->file.number();
  if (descriptor < 0 && errno == ENOENT) return std::nullopt;
  if (descriptor < 0 && (errno == ENXIO || errno == ELOOP || errno == EISDIR)) throw_foreign(path);
  if (descriptor < 0) system_error("cannot open " + path, errno);
  struct stat status {};
  if (::fstat(descriptor, &status) != 0) system_error("cannot open " + path, errno);
  // Its owner could truncate the file under this process, which would be a SIGBUS.
  if (!S_ISREG(status.st_mode) || status.st_uid != ::geteuid()) throw_foreign(path);
  if (status.st_size <= 0) throw Error(ErrorCode::kCorrupt, path + ": truncated: 0 bytes");
  impl->liveness = LivenessLock(path, access == Access::kReadOnly ? O_RDONLY : O_RDWR, descriptor);
  impl->region = map(impl->file, mode, path);
  return Segment(std::move(impl));
}

LivenessLock& Segment::liveness() noexcept { return impl_->liveness; }
bool Segment::is_in_place() const noexcept { return is_still(impl_->file.number(), impl_->path); }

std::span<std::byte> Segment::bytes() noexcept {
  return {static_cast<std::byte*>(impl_->region.get_address()), impl_->region.get_size()};
}

void reclaim_or_throw(const std::string& name) {
  const std::string path = path_of(name);
  struct stat status {};
  if (::lstat(path.c_str(), &status) != 0) return;
  const SegmentInfo found = inspect_segment(file_name(name));
  if (found.ownership == Ownership::kLiving)
    throw Error(ErrorCode::kSurfaceLives,
                "surface \"" + name + "\" is already running as process " +
                    std::to_string(found.surface_pid) + "; choose another name or end it first",
                found.surface_pid);
  if (found.ownership == Ownership::kForeign) {
    if (::lstat(path.c_str(), &status) != 0) return;  // removed since the first check
    throw_foreign(path);
  }
  if (remove_if_orphan(file_name(name)) || ::lstat(path.c_str(), &status) != 0) return;
  if (inspect_segment(file_name(name)).ownership == Ownership::kOrphan)
    throw Error(ErrorCode::kForeign, path +
                                         " cannot be removed: another process holds its lock, or the "
                                         "directory is not writable; choose another name");
}

}  // namespace shm_protocol
