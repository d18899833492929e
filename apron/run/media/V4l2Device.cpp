#include "apron/run/media/V4l2Device.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <vector>

#include "apron/run/media/MediaError.h"
#include "apron/run/media/MediaFile.h"

namespace apron::run {
namespace {

class LinuxV4l2Device final : public V4l2Device {
 public:
  explicit LinuxV4l2Device(int fd) : fd_(fd) {}
  LinuxV4l2Device(const LinuxV4l2Device&) = delete;
  LinuxV4l2Device& operator=(const LinuxV4l2Device&) = delete;
  ~LinuxV4l2Device() override {
    for (const Mapping& mapping : mappings_) munmap(mapping.begin, mapping.bytes);
    close(fd_);
  }

  int control(unsigned long request, void* argument) override {
    int result = 0;
    do result = ioctl(fd_, request, argument);
    while (result == -1 && errno == EINTR);
    return result == -1 ? errno : 0;
  }

  std::span<const std::uint8_t> map(std::size_t bytes, std::int64_t offset) override {
    void* const begin = mmap(nullptr, bytes, PROT_READ, MAP_SHARED, fd_, static_cast<off_t>(offset));
    if (begin == MAP_FAILED) return {};
    mappings_.push_back({begin, bytes});
    return {static_cast<const std::uint8_t*>(begin), bytes};
  }

  int wait(int milliseconds) override {
    pollfd descriptor{fd_, POLLIN, 0};
    const int ready = poll(&descriptor, 1, milliseconds);
    if (ready == -1) return errno;
    if (ready == 0) return ETIMEDOUT;
    return (descriptor.revents & POLLIN) != 0 ? 0 : ENODEV;
  }

 private:
  struct Mapping {
    void* begin;
    std::size_t bytes;
  };
  int fd_;
  std::vector<Mapping> mappings_;
};

}  // namespace

std::unique_ptr<V4l2Device> open_v4l2_device(const std::string& path) {
  struct stat status {};
  if (stat(path.c_str(), &status) != 0 && errno == ENOENT)
    throw MediaError(vm::HostStatus::kRefused,
                     "there is no camera '" + path + "'; select another one, or a .y4m video, with --camera");
  constexpr unsigned kVideo = 81;  // Linux's number of video devices
  if (!S_ISCHR(status.st_mode)) throw_refused(path, "is not a camera; the name of a video must end in .y4m");
  if (major(status.st_rdev) != kVideo) throw_refused(path, "is not a camera");
  const int fd = open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
  if (fd != -1) return std::make_unique<LinuxV4l2Device>(fd);
  const int error = errno;
  const std::string hint = error == EACCES ? "; usually only members of the group 'video' may open it" : "";
  throw MediaError(vm::HostStatus::kRefused,
                   "cannot open the camera '" + path + "': " + std::strerror(error) + hint);
}

}  // namespace apron::run
