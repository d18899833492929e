#include "shm_protocol/SurfaceName.h"

#include <fcntl.h>
#include <stdio.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>
#include <exception>
#include <utility>

#include "Ownership.h"
#include "ProcessIdentity.h"
#include "Segment.h"
#include "SegmentLayout.h"
#include "SegmentNames.h"
#include "SurfaceNameImpl.h"
#include "shm_protocol/Error.h"

namespace shm_protocol {

SurfaceName::SurfaceName(const std::string& name) : impl_(std::make_unique<Impl>()) {
  check_name(name);
  reclaim_or_throw(name);
  remove_orphans_of(name);  // builders that were killed
  impl_->name = name;
  impl_->path = path_of(name);
  impl_->builder = ::getpid();
  static std::atomic<unsigned> build_count{0};  // two threads may build under one name; one will be refused
  impl_->temporary_path = std::string(kShmDirectory) + "/" + file_name(name) + kBuildMarker +
                          std::to_string(own_process_identity()) + "." + std::to_string(build_count++);
  impl_->file = FileDescriptor(
      ::open(impl_->temporary_path.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0600));
  if (impl_->file.number() < 0) system_error("cannot create " + impl_->path, errno);
}

SurfaceName::~SurfaceName() {
  if (impl_->file.number() >= 0 && !impl_->in_place && impl_->builder == ::getpid())
    ::unlink(impl_->temporary_path.c_str());
}

const std::string& SurfaceName::name() const noexcept { return impl_->name; }
const std::string& SurfaceName::file() const noexcept { return impl_->temporary_path; }

void SurfaceName::put_in_place() {
  if (impl_->put_in_place_elsewhere) {
    impl_->put_in_place_elsewhere();
    impl_->in_place = true;
    return;
  }
  for (int attempt = 0; attempt < 100; ++attempt) {
    reclaim_or_throw(impl_->name);
    if (::renameat2(AT_FDCWD, impl_->temporary_path.c_str(), AT_FDCWD, impl_->path.c_str(),
                    RENAME_NOREPLACE) == 0) {
      impl_->in_place = true;
      return;
    }
    if (errno != EEXIST) break;
  }
  system_error("cannot put " + impl_->path + " in place", errno);
}

void SurfaceName::remove() noexcept {
  if (impl_->remove_elsewhere) {
    try {
      impl_->remove_elsewhere();
    } catch (const std::exception&) {  // that process has ended: the next surface reclaims the name
    }
    return;
  }
  const int descriptor = impl_->file.number();
  // The lock serialises this with a cleaner that has just found the same file (see remove_if_orphan). A
  // cleaner holds it for microseconds, and removes nothing while this process lives.
  lock_within_bound(descriptor);
  if (is_still(descriptor, impl_->path)) ::unlink(impl_->path.c_str());
  ::flock(descriptor, LOCK_UN);
}

void SurfaceName::delegate(std::function<void()> put_in_place, std::function<void()> remove) {
  impl_->put_in_place_elsewhere = std::move(put_in_place);
  impl_->remove_elsewhere = std::move(remove);
}

}  // namespace shm_protocol
