#include "Segment.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <boost/interprocess/mapped_region.hpp>
#include <cerrno>
#include <cstring>
#include <utility>

#include "Ownership.h"
#include "SurfaceNameImpl.h"
#include "shm_protocol/Error.h"

namespace shm_protocol {
namespace {

namespace bip = boost::interprocess;

void require_own(const struct stat& status, const std::string& path) {
  if (status.st_uid != ::geteuid())
    throw Error(ErrorCode::kForeign, path + " belongs to another user (" + std::to_string(status.st_uid) +
                                         "), who alone may map it; choose another name");
}

[[noreturn]] void throw_foreign(const std::string& path) {
  struct stat status {};
  if (::lstat(path.c_str(), &status) == 0) require_own(status, path);
  throw Error(ErrorCode::kForeign,
              path + " is not a segment of this protocol; remove it by hand or choose another name");
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
  std::string path;                       // of the final name
  std::shared_ptr<SurfaceName> reserved;  // null for a segment that was opened
  FileDescriptor opened;                  // of a segment that was opened
  LivenessLock liveness;
  bip::mapped_region region;

  const FileDescriptor& file() const noexcept { return reserved ? reserved->impl_->file : opened; }
};

void system_error(const std::string& what, int number) {
  throw Error(ErrorCode::kSystem, what + ": " + std::strerror(number));
}

std::string path_of(const std::string& name) { return std::string(kShmDirectory) + "/" + file_name(name); }

Segment::Segment(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Segment::Segment(Segment&&) noexcept = default;
Segment& Segment::operator=(Segment&&) noexcept = default;

Segment::~Segment() = default;

Segment Segment::create(std::shared_ptr<SurfaceName> reserved, std::size_t bytes) {
  auto impl = std::make_unique<Impl>();
  impl->path = path_of(reserved->name());
  impl->reserved = std::move(reserved);
  const FileDescriptor& file = impl->file();
  impl->liveness = LivenessLock(impl->reserved->file(), O_RDWR, file.number());
  impl->liveness.take(Side::kSurface);
  // Reserve the memory now, so that a full /dev/shm is an error here and not a SIGBUS during a run.
  if (const int failure = ::posix_fallocate(file.number(), 0, static_cast<off_t>(bytes)))
    system_error("cannot reserve " + std::to_string(bytes) + " bytes in /dev/shm for " + impl->path, failure);
  impl->region = map(file, bip::read_write, impl->path);
  return Segment(std::move(impl));
}

void Segment::rename_into_place() { impl_->reserved->put_in_place(); }

void Segment::remove() noexcept { impl_->reserved->remove(); }

std::optional<Segment> Segment::open(const std::string& name, Access access) {
  const bip::mode_t mode = access == Access::kReadOnly ? bip::read_only : bip::read_write;
  const std::string path = path_of(name);
  auto impl = std::make_unique<Impl>();
  impl->path = path;
  impl->opened = FileDescriptor(open_untrusted(path, access == Access::kReadOnly ? O_RDONLY : O_RDWR));
  const int descriptor = impl->opened.number();
  if (descriptor < 0 && errno == ENOENT) return std::nullopt;
  if (descriptor < 0 && (errno == ENXIO || errno == ELOOP || errno == EISDIR)) throw_foreign(path);
  struct stat status {};
  if (descriptor < 0) {
    const int failure = errno;
    if (failure == EACCES && ::lstat(path.c_str(), &status) == 0) require_own(status, path);
    system_error("cannot open " + path, failure);
  }
  if (::fstat(descriptor, &status) != 0) system_error("cannot open " + path, errno);
  // Its owner could truncate the file under this process, which would be a SIGBUS.
  if (!S_ISREG(status.st_mode)) throw_foreign(path);
  require_own(status, path);
  if (status.st_size <= 0) throw Error(ErrorCode::kCorrupt, path + ": truncated: 0 bytes");
  impl->liveness = LivenessLock(path, access == Access::kReadOnly ? O_RDONLY : O_RDWR, descriptor);
  impl->region = map(impl->opened, mode, path);
  return Segment(std::move(impl));
}

LivenessLock& Segment::liveness() noexcept { return impl_->liveness; }
bool Segment::is_in_place() const noexcept { return is_still(impl_->file().number(), impl_->path); }

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
