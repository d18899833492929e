#include "apron/run/CaptureDevice.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <vector>

#include "apron/run/MediaError.h"
#include "apron/run/MediaFile.h"

namespace apron::run {
namespace {

class SystemDevice final : public CaptureDevice {
 public:
  explicit SystemDevice(int file) : file_(file) {}
  SystemDevice(const SystemDevice&) = delete;
  SystemDevice& operator=(const SystemDevice&) = delete;
  ~SystemDevice() override {
    for (const Mapped& one : mapped_) munmap(one.begin, one.bytes);
    close(file_);
  }

  int control(unsigned long request, void* argument) override {
    int result = 0;
    do result = ioctl(file_, request, argument);
    while (result == -1 && errno == EINTR);
    return result == -1 ? errno : 0;
  }

  std::span<const std::uint8_t> map(std::size_t bytes, std::int64_t offset) override {
    void* const begin = mmap(nullptr, bytes, PROT_READ, MAP_SHARED, file_, static_cast<off_t>(offset));
    if (begin == MAP_FAILED) return {};
    mapped_.push_back({begin, bytes});
    return {static_cast<const std::uint8_t*>(begin), bytes};
  }

  int wait(int milliseconds) override {
    pollfd one{file_, POLLIN, 0};
    const int ready = poll(&one, 1, milliseconds);
    if (ready == -1) return errno;
    if (ready == 0) return ETIMEDOUT;
    return (one.revents & POLLIN) != 0 ? 0 : ENODEV;
  }

 private:
  struct Mapped {
    void* begin;
    std::size_t bytes;
  };
  int file_;
  std::vector<Mapped> mapped_;
};

}  // namespace

std::unique_ptr<CaptureDevice> open_capture_device(const std::string& path) {
  struct stat about {};
  if (stat(path.c_str(), &about) != 0 && errno == ENOENT)
    throw MediaError(
        vm::HostStatus::kRefused,
        "there is no camera '" + path + "'; --camera names another one, or a .y4m video in its place");
  if (S_ISREG(about.st_mode) || S_ISDIR(about.st_mode))
    refuse(path, "is no camera; a video in its place must end in .y4m");
  const int file = open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
  if (file != -1) return std::make_unique<SystemDevice>(file);
  const int why = errno;
  const std::string advice = why == EACCES ? "; members of the group 'video' usually may use it" : "";
  throw MediaError(vm::HostStatus::kRefused,
                   "cannot open the camera '" + path + "': " + std::strerror(why) + advice);
}

}  // namespace apron::run
