// The Video4Linux2 system calls, behind an interface that tests replace.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

namespace apron::run {

class V4l2Device {
 public:
  virtual ~V4l2Device() = default;

  // ioctl(), retried after EINTR. Returns 0 or errno.
  virtual int control(unsigned long request, void* argument) = 0;
  // mmap() of a driver buffer, valid until the device is closed. Empty on failure.
  virtual std::span<const std::uint8_t> map(std::size_t bytes, std::int64_t offset) = 0;
  // poll() for a filled buffer. Returns 0, ETIMEDOUT, EINTR or another errno.
  virtual int wait(int milliseconds) = 0;
};

// Opens the device; destroying it closes it. Throws MediaError if the path does not exist, is not accessible
// or is not a device.
std::unique_ptr<V4l2Device> open_v4l2_device(const std::string& path);

}  // namespace apron::run
